# Netduino Plus 2 (STM32F405): Cortex-M4 with FPU. QEMU: -machine netduinoplus2.
set(PVID_BOARD_FAMILY cortex_m)
set(PVID_BOARD_CPU -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard)
set(PVID_BOARD_UART stm32f4)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x40011000u PVID_UART_IRQ=37u PVID_CLOCK_HZ=168000000u)
set(PVID_BOARD_MEMORY code_origin=0x08000000 code_bytes=1M ram_origin=0x20000000 ram_bytes=128K stack_bytes=16K)
