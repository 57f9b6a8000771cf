# ATmega328P at 16 MHz, no FPU, double as narrow as float. simavr: -m atmega328p -f 16000000.
set(PVID_BOARD_FAMILY avr)
set(PVID_BOARD_CPU -mmcu=atmega328p)
set(PVID_BOARD_DEFINITIONS F_CPU=16000000UL)
