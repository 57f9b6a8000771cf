"""Filters and tables of both forms, and what they cost."""
