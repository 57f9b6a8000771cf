"""A platform on four mecanum wheels."""
