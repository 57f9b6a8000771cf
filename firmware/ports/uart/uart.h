/* What a board's UART driver offers its port. None of the functions waits, but for drain.
 *
 * PVID_UART_BASE (from boards/NAME.cmake) is the address of its registers. */
#ifndef PVID_UART_H
#define PVID_UART_H

#include <stdbool.h>
#include <stdint.h>

#define PVID_UART_REGISTER(offset) (*(volatile uint32_t *)(uintptr_t)(PVID_UART_BASE + (offset)))

void pvid_uart_init(void);

/* Whether a byte has arrived; if so it is taken. */
bool pvid_uart_get(uint8_t *byte);

/* Whether there was room for `byte`; if so it is on its way. */
bool pvid_uart_put(uint8_t byte);

/* Has the UART interrupt when a byte arrives, which pvid_uart_interrupt then serves. */
void pvid_uart_enable_receive(void);

/* Takes the interrupt back, before a byte is taken. */
void pvid_uart_acknowledge(void);

/* ports/uart/receiver.c; weak in the start-up, which calls it. */
void pvid_uart_interrupt(void);

/* Waits until all bytes are sent. */
void pvid_uart_drain(void);

#endif
