"""A tank with an outlet."""
