/* Runs an AVR image in libsimavr with USART0 on standard input and output, byte for byte.
 *
 *   simavr_stdio PART IMAGE.elf        e.g. atmega2560, at 16 MHz
 *
 * Ends when the image sleeps with its interrupts off, with the code it left in GPIOR0 (firmware/ports/avr). The
 * `simavr` of the distribution shows printable characters only, and has no exit code. Input is handed over when
 * the USART has room, so nothing is lost at any speed.
 */
#include <errno.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#define CLOCK_HZ 16000000u
#define GPIOR0 0x3Eu
#define INSTRUCTIONS_PER_LOOK 512u /* at standard input */

static bool room; /* the USART takes another byte */
static int sent;  /* descriptor of what was standard output: the library prints there, too */

static void on_byte(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    const uint8_t byte = (uint8_t)value;
    while ((write(sent, &byte, 1) < 0) && (errno == EINTR)) {
    }
}

static void on_room(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    room = true;
}

static void on_full(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    room = false;
}

/* Hands what has arrived on standard input to the USART; false when there will be no more. */
static bool feed(avr_irq_t *input)
{
    struct pollfd ready = {.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    while (room && (poll(&ready, 1, 0) == 1)) {
        uint8_t byte;
        if (read(STDIN_FILENO, &byte, 1) != 1) {
            return false;
        }
        avr_raise_irq(input, byte); /* may call on_full */
    }
    return true;
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

int main(int argc, char **argv)
{
    sent = dup(STDOUT_FILENO);
    (void)dup2(STDERR_FILENO, STDOUT_FILENO);
    elf_firmware_t firmware = {0};
    if ((argc != 3) || (elf_read_firmware(argv[2], &firmware) != 0)) {
        fprintf(stderr, "usage: simavr_stdio PART IMAGE.elf\n");
        return 2;
    }
    avr_t *avr = avr_make_mcu_by_name(argv[1]);
    if (avr == NULL) {
        fprintf(stderr, "simavr_stdio: simavr knows no %s\n", argv[1]);
        return 2;
    }
    avr_init(avr);
    avr->log = LOG_ERROR;
    avr->frequency = CLOCK_HZ;
    avr->sleep = no_sleep; /* as fast as it can */
    avr_load_firmware(avr, &firmware);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_t *usart = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
    avr_irq_register_notify(&usart[UART_IRQ_OUTPUT], on_byte, NULL);
    avr_irq_register_notify(&usart[UART_IRQ_OUT_XON], on_room, NULL);
    avr_irq_register_notify(&usart[UART_IRQ_OUT_XOFF], on_full, NULL);
    bool more = true;
    for (uint32_t i = 0;; i++) {
        const int state = avr_run(avr);
        if ((state == cpu_Done) || (state == cpu_Crashed)) {
            return (state == cpu_Done) ? avr->data[GPIOR0] : 111;
        }
        if (more && ((i % INSTRUCTIONS_PER_LOOK) == 0u)) {
            more = feed(&usart[UART_IRQ_INPUT]);
        }
    }
}
