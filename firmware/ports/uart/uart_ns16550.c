/* The NS16550A, registers a byte apart, sixteen bytes of buffer each way. */
#include "uart.h"

#define REGISTER(offset) (*(volatile uint8_t *)(uintptr_t)(PVID_UART_BASE + (offset)))
#define DATA REGISTER(0u)
#define INTERRUPT_ENABLE REGISTER(1u)
#define FIFO_CONTROL REGISTER(2u)
#define LINE_CONTROL REGISTER(3u)
#define LINE_STATUS REGISTER(5u)

#define FIFO_ENABLE_AND_CLEAR 0x07u
#define INTERRUPT_RX 0x01u
#define LINE_8N1 0x03u
#define STATUS_RX_READY 0x01u
#define STATUS_TX_EMPTY 0x20u
#define STATUS_TX_IDLE 0x40u

void pvid_uart_init(void)
{
    LINE_CONTROL = LINE_8N1;
    FIFO_CONTROL = FIFO_ENABLE_AND_CLEAR;
    (void)DATA; /* discards earlier bytes; an emulator that waits for this continues */
}

bool pvid_uart_get(uint8_t *byte)
{
    if ((LINE_STATUS & STATUS_RX_READY) == 0u) {
        return false;
    }
    *byte = DATA;
    return true;
}

bool pvid_uart_put(uint8_t byte)
{
    if ((LINE_STATUS & STATUS_TX_EMPTY) == 0u) {
        return false;
    }
    DATA = byte;
    return true;
}

void pvid_uart_enable_receive(void)
{
    INTERRUPT_ENABLE = INTERRUPT_RX;
}

/* Reading the bytes does it. */
void pvid_uart_acknowledge(void)
{
}

void pvid_uart_drain(void)
{
    while ((LINE_STATUS & STATUS_TX_IDLE) == 0u) {
    }
}
