"""The two-link Kapitza pendulum."""
