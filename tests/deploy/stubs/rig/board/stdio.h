/* What firmware/examples/commission.c and bits.c need of <stdio.h>: board.c. */
int printf(const char *format, ...);
