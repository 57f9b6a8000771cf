"""A vehicle that rolls out."""
