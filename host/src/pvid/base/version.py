"""The version, that of firmware/include/pvid/version.h."""

__version__ = "0.1.0"
