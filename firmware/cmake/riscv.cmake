# Toolchain of every 32-bit RISC-V: Debian's gcc-riscv64-unknown-elf, no C library needed. The core's own options
# come from ports/boards/NAME.cmake (PVID_BOARD) or from CMAKE_C_FLAGS.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)
set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
