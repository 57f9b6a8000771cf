/* The receiver behind a UART's interrupt. What does not fit stays in the UART, its interrupt off until there is room.
 */
#include "../receiver.h"

#include "../interrupts.h"
#include "uart.h"

#define MASK (PVID_RECEIVER_BYTES - 1u)

static volatile uint8_t ring[PVID_RECEIVER_BYTES];
static volatile uint32_t put;   /* bytes received; only the interrupt writes it */
static volatile uint32_t taken; /* of them; the program alone writes it */

void pvid_uart_interrupt(void)
{
    uint8_t byte;
    while ((put - taken) < PVID_RECEIVER_BYTES) {
        pvid_uart_acknowledge(); /* only where the byte is then taken: a UART may call for it no second time */
        if (!pvid_uart_get(&byte)) {
            return;
        }
        ring[put & MASK] = byte;
        put++;
    }
    pvid_interrupts_uart(false);
}

void pvid_receiver_init(void)
{
    pvid_uart_enable_receive();
    pvid_interrupts_init();
    /* An earlier byte would block all later ones if the UART interrupts only when a byte arrives. */
    pvid_interrupts_mask();
    pvid_uart_interrupt();
    pvid_interrupts_unmask();
}

size_t pvid_receiver_take(uint8_t bytes[], size_t room)
{
    size_t n = 0;
    while ((n < room) && (taken != put)) {
        bytes[n] = ring[taken & MASK];
        taken++;
        n++;
    }
    if (n > 0u) {
        pvid_interrupts_uart(true);
    }
    return n;
}

void pvid_receiver_rest(void)
{
    pvid_interrupts_mask();
    if (taken == put) {
        pvid_interrupts_wait();
    }
    pvid_interrupts_unmask();
}
