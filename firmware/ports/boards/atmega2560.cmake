# ATmega2560 at 16 MHz, no FPU, double as narrow as float. simavr: -m atmega2560 -f 16000000.
set(PVID_BOARD_FAMILY avr)
set(PVID_BOARD_CPU -mmcu=atmega2560)
set(PVID_BOARD_DEFINITIONS F_CPU=16000000UL)
