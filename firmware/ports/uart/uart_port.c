/* pvid_port_receive and pvid_port_send over a UART driver that is polled. */
#include "port.h"
#include "uart.h"

size_t pvid_port_receive(uint8_t bytes[], size_t room)
{
    size_t n = 0;
    while ((n < room) && pvid_uart_get(&bytes[n])) {
        n++;
    }
    return n;
}

size_t pvid_port_send(const uint8_t bytes[], size_t n)
{
    size_t taken = 0;
    while ((taken < n) && pvid_uart_put(bytes[taken])) {
        taken++;
    }
    return taken;
}
