"""A DC motor with current sensor and tachometer."""
