"""A heated body in air."""
