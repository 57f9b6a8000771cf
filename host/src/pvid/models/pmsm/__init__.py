"""A permanent-magnet synchronous motor in d-q coordinates."""
