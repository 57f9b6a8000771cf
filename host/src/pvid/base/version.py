"""The version, printed by tools/print_headers.py from version.h."""

__version__ = "0.3.0"
