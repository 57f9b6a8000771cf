"""Refinement in float64: the full equations fitted to the whole run, by output error and multiple shooting."""
