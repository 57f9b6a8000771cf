"""The version: that of firmware/include/pvid/version.h (tests/tools)."""

__version__ = "0.1.0"
