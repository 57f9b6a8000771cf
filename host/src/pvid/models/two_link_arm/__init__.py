"""An arm with two driven joints."""
