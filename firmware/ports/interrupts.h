/* ports/interrupts.h - what the receiver needs of a core's interrupts: the UART's, and to sleep until it comes. */
#ifndef PVID_INTERRUPTS_H
#define PVID_INTERRUPTS_H

#include <stdbool.h>

/* Prepares the UART's interrupt and lets it through. */
void pvid_interrupts_init(void);

/* Lets it through, or not. */
void pvid_interrupts_uart(bool on);

/* While masked an interrupt is not served, but ends pvid_interrupts_wait. */
void pvid_interrupts_mask(void);
void pvid_interrupts_unmask(void);
void pvid_interrupts_wait(void);

#endif
