"""Steps of voltage at a winding."""
