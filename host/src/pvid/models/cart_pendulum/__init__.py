"""A pendulum on a cart."""
