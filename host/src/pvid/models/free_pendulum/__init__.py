"""A pendulum that swings freely."""
