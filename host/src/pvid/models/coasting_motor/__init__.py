"""A motor that runs out."""
