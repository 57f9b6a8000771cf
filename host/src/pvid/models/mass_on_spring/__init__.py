"""A mass on a spring, driven by a known force."""
