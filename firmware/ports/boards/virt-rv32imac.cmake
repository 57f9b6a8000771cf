# QEMU's RISC-V board as rv32imac, no FPU. QEMU: qemu-system-riscv32 -machine virt -bios none.
set(PVID_BOARD_FAMILY riscv)
set(PVID_BOARD_CPU -march=rv32imac -mabi=ilp32 -mcmodel=medany)
set(PVID_BOARD_UART ns16550)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x10000000u PVID_UART_IRQ=10u)
set(PVID_BOARD_MEMORY code_origin=0x80000000 code_bytes=8M ram_origin=0x80800000 ram_bytes=8M stack_bytes=16K)
