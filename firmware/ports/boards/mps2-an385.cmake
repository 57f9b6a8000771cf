# Arm MPS2 with image AN385: Cortex-M3, no FPU. QEMU: -machine mps2-an385.
set(PVID_BOARD_FAMILY cortex_m)
set(PVID_BOARD_CPU -mcpu=cortex-m3 -mfloat-abi=soft)
set(PVID_BOARD_UART cmsdk)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x40004000u PVID_UART_IRQ=0u PVID_CLOCK_HZ=25000000u)
set(PVID_BOARD_MEMORY code_origin=0 code_bytes=4M ram_origin=0x20000000 ram_bytes=4M stack_bytes=16K)
