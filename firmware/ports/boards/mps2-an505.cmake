# Arm MPS2+ with image AN505: Cortex-M33 with FPU, in Secure state. QEMU: -machine mps2-an505.
set(PVID_BOARD_FAMILY cortex_m)
set(PVID_BOARD_CPU -mcpu=cortex-m33 -mfpu=fpv5-sp-d16 -mfloat-abi=hard)
set(PVID_BOARD_UART cmsdk)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x50200000u PVID_UART_IRQ=32u PVID_CLOCK_HZ=20000000u)
set(PVID_BOARD_MEMORY code_origin=0x10000000 code_bytes=4M ram_origin=0x38000000 ram_bytes=2M stack_bytes=16K)
