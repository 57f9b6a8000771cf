/* UART of the nRF51: tasks and events, six bytes of receive buffer. */
#include "uart.h"

#define START_RX PVID_UART_REGISTER(0x000u)
#define START_TX PVID_UART_REGISTER(0x008u)
#define RX_READY PVID_UART_REGISTER(0x108u)
#define TX_READY PVID_UART_REGISTER(0x11Cu)
#define INTERRUPT_SET PVID_UART_REGISTER(0x304u)
#define ENABLE PVID_UART_REGISTER(0x500u)
#define PIN_TX PVID_UART_REGISTER(0x50Cu)
#define PIN_RX PVID_UART_REGISTER(0x514u)
#define RXD PVID_UART_REGISTER(0x518u)
#define TXD PVID_UART_REGISTER(0x51Cu)
#define BAUDRATE PVID_UART_REGISTER(0x524u)

#define ENABLE_UART 4u
#define INTERRUPT_RX_READY 0x4u
#define BAUD_115200 0x01D7E000u

static bool sending; /* a byte was put, and its TX_READY has not occurred yet */

void pvid_uart_init(void)
{
    PIN_TX = 24u; /* the micro:bit's USB serial port */
    PIN_RX = 25u;
    BAUDRATE = BAUD_115200;
    ENABLE = ENABLE_UART;
    RX_READY = 0u;
    TX_READY = 0u;
    START_RX = 1u;
    START_TX = 1u;
    sending = false;
}

bool pvid_uart_get(uint8_t *byte)
{
    if (RX_READY == 0u) {
        return false;
    }
    RX_READY = 0u; /* before the read: the next byte raises it again */
    *byte = (uint8_t)RXD;
    return true;
}

bool pvid_uart_put(uint8_t byte)
{
    if (sending) {
        if (TX_READY == 0u) {
            return false;
        }
        TX_READY = 0u;
    }
    TXD = byte;
    sending = true;
    return true;
}

void pvid_uart_enable_receive(void)
{
    INTERRUPT_SET = INTERRUPT_RX_READY;
}

/* Clearing the event before each read of a byte acknowledges it. */
void pvid_uart_acknowledge(void)
{
}

void pvid_uart_drain(void)
{
    while (sending && (TX_READY == 0u)) {
    }
}
