/* The receiver behind a UART's interrupt: whatever moment a byte comes at, it is neither lost nor does it hold up the
 * next, with a UART that calls as a byte arrives and with one that calls as long as one is there. */
#include "test.h"

#include "interrupts.h"
#include "receiver.h"
#include "uart/uart.h"

#define BYTES 5000u

/* A UART with one byte of buffer, whose other end waits until there is room, as an emulator's does. */
static struct {
    bool calls_once; /* as a byte arrives; else as long as it is there */
    bool listening;
    bool calling;
    bool full;
    uint8_t buffer;
    uint32_t sent; /* by the other end */
} uart;

static struct {
    bool through;
    bool masked;
    bool serving;
} core;

static uint32_t random_state;

static uint32_t below(uint32_t n)
{
    random_state = (1664525u * random_state) + 1013904223u;
    return (random_state >> 16) % n;
}

static bool calls(void)
{
    return uart.calls_once ? uart.calling : (uart.listening && uart.full);
}

static void serve(void)
{
    while (calls() && core.through && !core.masked && !core.serving) {
        core.serving = true;
        pvid_uart_interrupt();
        core.serving = false;
    }
}

static void arrive(void)
{
    if (!uart.full && (uart.sent < BYTES)) {
        uart.full = true;
        uart.buffer = (uint8_t)(7u * uart.sent);
        uart.sent++;
        uart.calling = uart.listening;
    }
}

/* Time passes: a byte may come, and be served if that is let through. */
static void meanwhile(void)
{
    if (below(3) == 0u) {
        arrive();
    }
    serve();
}

void pvid_uart_enable_receive(void)
{
    meanwhile();
    uart.listening = true;
    meanwhile();
}

void pvid_uart_acknowledge(void)
{
    meanwhile();
    uart.calling = false;
    meanwhile();
}

bool pvid_uart_get(uint8_t *byte)
{
    meanwhile();
    const bool any = uart.full;
    *byte = uart.buffer;
    uart.full = false;
    meanwhile();
    return any;
}

void pvid_interrupts_init(void)
{
    pvid_interrupts_uart(true);
}

void pvid_interrupts_uart(bool on)
{
    meanwhile();
    core.through = on;
    meanwhile();
}

void pvid_interrupts_mask(void)
{
    core.masked = true;
    meanwhile();
}

void pvid_interrupts_unmask(void)
{
    meanwhile();
    core.masked = false;
    meanwhile();
}

/* Ends with the next byte, which nothing but it could bring. */
void pvid_interrupts_wait(void)
{
    arrive();
    assert_true(calls());
}

static void every_byte_comes_in_order(void **state)
{
    uint8_t bytes[64];
    for (uint32_t seed = 0; seed < 64u; seed++) {
        memset(&uart, 0, sizeof uart);
        memset(&core, 0, sizeof core);
        random_state = seed;
        uart.calls_once = (seed % 2u) == 0u;
        if ((seed % 4u) < 2u) {
            arrive(); /* before anybody listens */
        }
        pvid_receiver_init();
        uint32_t taken = 0;
        uint32_t idle = 0;
        while ((taken < BYTES) && (idle < 1000u)) {
            const uint32_t busy = below(4) == 0u ? 600u : 1u; /* the ring overflows now and then */
            for (uint32_t i = 0; i < busy; i++) {
                meanwhile();
            }
            const size_t n = pvid_receiver_take(bytes, 1u + below(sizeof bytes));
            for (size_t i = 0; i < n; i++) {
                assert_int_equal(bytes[i], (uint8_t)(7u * taken));
                taken++;
            }
            idle = (n > 0u) ? 0u : (idle + 1u);
            if ((n == 0u) && (taken < BYTES) && (uart.sent < BYTES)) {
                pvid_receiver_rest();
            }
        }
        assert_int_equal(taken, BYTES);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_byte_comes_in_order)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
