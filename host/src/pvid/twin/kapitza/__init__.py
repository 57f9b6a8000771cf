"""The pendulum's own parts of the twin."""
