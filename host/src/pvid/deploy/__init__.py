"""A mechanism's identifier for a rig as a package: Arduino, PlatformIO, ESP-IDF, Zephyr, CMake, CubeMX."""
