"""A rotary pendulum."""
