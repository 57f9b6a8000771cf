"""The fixed-point core in numpy, integer by integer."""
