"""A synchronous buck converter."""
