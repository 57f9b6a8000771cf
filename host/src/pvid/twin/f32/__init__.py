"""The float32 core in numpy, operation by operation."""
