/* The receiver behind a UART's interrupt: its counters are volatile, so that Eva reads another value of them each time,
 * as if any number of bytes had come and gone between any two reads. */
#include "prove.h"

#include "interrupts.h"
#include "receiver.h"
#include "uart/uart.h"

void pvid_uart_enable_receive(void)
{
}

void pvid_uart_acknowledge(void)
{
}

bool pvid_uart_get(uint8_t *byte)
{
    *byte = (uint8_t)any_u32(0, 255);
    return any_bool();
}

void pvid_interrupts_init(void)
{
}

void pvid_interrupts_mask(void)
{
}

void pvid_interrupts_unmask(void)
{
}

void pvid_interrupts_wait(void)
{
}

void pvid_interrupts_uart(bool allowed)
{
    (void)allowed;
}

void main(void)
{
    uint8_t bytes[64];
    pvid_receiver_init();
    while (any_bool()) {
        if (any_bool()) {
            pvid_uart_interrupt();
        } else {
            (void)pvid_receiver_take(bytes, any_u32(0, sizeof bytes));
            pvid_receiver_rest();
        }
    }
}
