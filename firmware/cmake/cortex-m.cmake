# Toolchain of every Cortex-M: Debian's gcc-arm-none-eabi, no C library needed. The core's own options come from
# ports/boards/NAME.cmake (PVID_BOARD) or from CMAKE_C_FLAGS.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
