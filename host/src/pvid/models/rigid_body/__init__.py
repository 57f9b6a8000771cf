"""A rigid body with gyros and known torques."""
