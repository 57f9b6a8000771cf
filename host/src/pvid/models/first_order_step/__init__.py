"""A process of first order with a dead time."""
