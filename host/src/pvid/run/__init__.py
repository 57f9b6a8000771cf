"""What is done with a recorded run: identify, compare, tune, explain."""
