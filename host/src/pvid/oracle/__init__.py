"""The method in float64, written apart from the C core and its twin."""
