"""Filters and tables of both forms, and their cost."""
