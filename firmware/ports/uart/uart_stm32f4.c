/* USART of the STM32F4, in the state its boot loader leaves it: clock and pins of a board of your own have
 * to be switched on first (RCC, GPIO); the emulator has neither. */
#include "uart.h"

#define SR PVID_UART_REGISTER(0x00u)
#define DR PVID_UART_REGISTER(0x04u)
#define BRR PVID_UART_REGISTER(0x08u)
#define CR1 PVID_UART_REGISTER(0x0Cu)

#define SR_RX_NOT_EMPTY 0x20u
#define SR_TX_COMPLETE 0x40u
#define SR_TX_EMPTY 0x80u
#define CR1_RX_ENABLE 0x0004u
#define CR1_RX_INTERRUPT 0x0020u
#define CR1_TX_ENABLE 0x0008u
#define CR1_USART_ENABLE 0x2000u

void pvid_uart_init(void)
{
    BRR = (PVID_CLOCK_HZ / 2u) / 115200u; /* APB2 runs at half the core's clock */
    CR1 = CR1_USART_ENABLE | CR1_TX_ENABLE | CR1_RX_ENABLE;
    (void)DR; /* discards earlier bytes; an emulator that waits for this continues */
}

bool pvid_uart_get(uint8_t *byte)
{
    if ((SR & SR_RX_NOT_EMPTY) == 0u) {
        return false;
    }
    *byte = (uint8_t)DR;
    return true;
}

bool pvid_uart_put(uint8_t byte)
{
    if ((SR & SR_TX_EMPTY) == 0u) {
        return false;
    }
    DR = byte;
    return true;
}

void pvid_uart_enable_receive(void)
{
    CR1 = CR1_USART_ENABLE | CR1_TX_ENABLE | CR1_RX_ENABLE | CR1_RX_INTERRUPT;
}

/* Reading the byte does it. */
void pvid_uart_acknowledge(void)
{
}

void pvid_uart_drain(void)
{
    while ((SR & SR_TX_COMPLETE) == 0u) {
    }
}
