# BBC micro:bit (nRF51822): Cortex-M0, no FPU. QEMU: -machine microbit.
set(PVID_BOARD_FAMILY cortex_m)
set(PVID_BOARD_CPU -mcpu=cortex-m0 -mfloat-abi=soft)
set(PVID_BOARD_UART nrf51)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x40002000u PVID_UART_IRQ=2u PVID_CLOCK_HZ=16000000u)
set(PVID_BOARD_MEMORY code_origin=0 code_bytes=256K ram_origin=0x20000000 ram_bytes=16K stack_bytes=4K no_guard=1)
