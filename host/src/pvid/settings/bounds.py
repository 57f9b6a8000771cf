"""Sizes that host/native builds the core with."""

MAX_WINDOW = 321  # samples of the differentiator
MAX_MOMENTS = 55
# Compiler options of the library and of whatever links with it (host/native/CMakeLists.txt).
SIZES = ("-DPVID_MAX_P=8", f"-DPVID_MAX_MOMENTS={MAX_MOMENTS}", "-DPVID_MAX_CONSTRAINTS=4", "-DPVID_MAX_DRIFTS=2")
