# OpenHW's CV32E40P with its FPU as `pvid bench cycles` simulates it from its RTL: the addresses of QEMU's `virt`, a
# counter of clock cycles, no protection of memory, no atomics.
set(PVID_BOARD_FAMILY riscv)
set(PVID_BOARD_CPU -march=rv32imfc -mabi=ilp32f -mcmodel=medany)
set(PVID_BOARD_UART ns16550)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x10000000u PVID_UART_IRQ=10u PVID_COUNTS_CYCLES=1 PVID_NO_PROTECTION=1)
set(PVID_BOARD_MEMORY code_origin=0x80000000 code_bytes=8M ram_origin=0x80800000 ram_bytes=8M stack_bytes=16K)
