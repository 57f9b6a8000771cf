"""Figures, reports, the terminal view and the live page."""
