"""Free oscillations that decay."""
