"""Recorded logs: recorder, reader, values, verification, export."""
