"""The C core against its twin, bit for bit, after every tick."""
