/* UART of Arm's Cortex-M System Design Kit: one byte of buffer each way. */
#include "uart.h"

#define DATA PVID_UART_REGISTER(0x00u)
#define STATE PVID_UART_REGISTER(0x04u)
#define CTRL PVID_UART_REGISTER(0x08u)
#define INTSTATUS PVID_UART_REGISTER(0x0Cu)
#define BAUDDIV PVID_UART_REGISTER(0x10u)

#define STATE_TX_FULL 0x1u
#define STATE_RX_FULL 0x2u
#define CTRL_TX_ENABLE 0x1u
#define CTRL_RX_ENABLE 0x2u
#define CTRL_RX_INTERRUPT 0x8u
#define INTSTATUS_RX 0x2u /* written: taken back */

void pvid_uart_init(void)
{
    BAUDDIV = PVID_CLOCK_HZ / 115200u;
    CTRL = CTRL_TX_ENABLE | CTRL_RX_ENABLE;
    (void)DATA; /* discards earlier bytes; an emulator that waits for this continues */
}

bool pvid_uart_get(uint8_t *byte)
{
    if ((STATE & STATE_RX_FULL) == 0u) {
        return false;
    }
    *byte = (uint8_t)DATA;
    return true;
}

bool pvid_uart_put(uint8_t byte)
{
    if ((STATE & STATE_TX_FULL) != 0u) {
        return false;
    }
    DATA = byte;
    return true;
}

void pvid_uart_enable_receive(void)
{
    CTRL = CTRL_TX_ENABLE | CTRL_RX_ENABLE | CTRL_RX_INTERRUPT;
}

void pvid_uart_acknowledge(void)
{
    INTSTATUS = INTSTATUS_RX;
}

void pvid_uart_drain(void)
{
    while ((STATE & STATE_TX_FULL) != 0u) {
    }
}
