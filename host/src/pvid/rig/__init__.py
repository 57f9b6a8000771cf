"""Rig files and recorded runs: reading, checking, clock, gaps, columns."""
