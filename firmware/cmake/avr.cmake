# Toolchain of every AVR: Debian's gcc-avr and avr-libc. The part comes from ports/boards/NAME.cmake (PVID_BOARD)
# or from CMAKE_C_FLAGS.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR avr)
set(CMAKE_C_COMPILER avr-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
