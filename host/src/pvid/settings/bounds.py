"""Sizes that host/native builds the core with."""

MAX_WINDOW = 321  # samples of the differentiator
MAX_MOMENTS = 55
# Compiler options of the library and of whatever links with it (host/native/CMakeLists.txt).
SIZES = (
    "-DPVID_MAX_P=6",
    f"-DPVID_MAX_MOMENTS={MAX_MOMENTS}",
)
