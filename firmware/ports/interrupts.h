/* ports/interrupts.h - interrupts of a core for the receiver: the UART's, and sleeping until it occurs. */
#ifndef PVID_INTERRUPTS_H
#define PVID_INTERRUPTS_H

#include <stdbool.h>

/* Initialises and enables the UART's interrupt. */
void pvid_interrupts_init(void);

/* Lets it through, or not. */
void pvid_interrupts_uart(bool on);

/* While masked an interrupt is not served, but ends pvid_interrupts_wait. */
void pvid_interrupts_mask(void);
void pvid_interrupts_unmask(void);
void pvid_interrupts_wait(void);

#endif
