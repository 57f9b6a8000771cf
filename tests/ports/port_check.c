/* Tries a port from the outside: what is to be tried comes over the UART, one letter a try. */
#include <math.h>
#include <string.h>

#include "port.h"
#include "report.h"

static volatile uint32_t initialised = 0x12345678u; /* from .data */
static volatile uint32_t cleared;                   /* from .bss */

static uint8_t next_byte(void)
{
    uint8_t byte;
    while (pvid_port_receive(&byte, 1) == 0u) {
    }
    return byte;
}

/* 'e': sends back what comes until a zero byte. */
static void echo(void)
{
    uint8_t byte;
    do {
        byte = next_byte();
        while (pvid_port_send(&byte, 1) == 0u) {
        }
    } while (byte != 0u);
}

/* 'c': what the counter makes of 1000 instructions. The smallest of two rounds, because an AVR's counter interrupts
 * one of them when it wraps (every 65536 cycles, at a time that depends on when the letter came). */
#define TEN(text) text text text text text text text text text text
static void count_instructions(void)
{
    uint32_t nothing = UINT32_MAX;
    uint32_t thousand = UINT32_MAX;
    for (volatile uint8_t round = 0; round < 2u; round++) {
        const uint32_t first = pvid_port_instructions();
        const uint32_t second = pvid_port_instructions();
        __asm__ volatile(TEN(TEN(TEN("nop\n\t"))));
        const uint32_t third = pvid_port_instructions();
        nothing = (second - first < nothing) ? second - first : nothing;
        thousand = (third - second < thousand) ? third - second : thousand;
    }
    report_number("nothing", nothing);
    report_number("thousand", thousand);
    report_number("counts_per_1024", pvid_port_counts_per_1024());
}

/* 't': what the clock makes of 50 000 instructions and those of the loop around them. */
static void time_instructions(void)
{
    const uint32_t from = pvid_port_microseconds();
    uint32_t to = from;
    for (volatile uint8_t round = 0; round < 50u; round++) {
        __asm__ volatile(TEN(TEN(TEN("nop\n\t"))));
        to = pvid_port_microseconds();
    }
    report_number("microseconds", to - from);
}

/* 's': how deep the stack has been, before and after a call that is n bytes deep. */
static __attribute__((noinline)) uint8_t deep(size_t n)
{
    volatile uint8_t block[1024];
    for (size_t i = 0; i < n; i++) {
        block[i] = (uint8_t)i;
    }
    return block[n - 1u];
}

static void measure_stack(void)
{
    report_number("before", (uint32_t)pvid_port_stack_used());
    report_number("last", deep(1024u));
    report_number("after", (uint32_t)pvid_port_stack_used());
    report_number("size", (uint32_t)pvid_port_stack_size());
}

/* 'r': square roots of this library, rounding decided by a remainder in integers: m^2 <= x < (m + 1)^2. */
static void square_roots(void)
{
    static const struct {
        uint32_t x;
        uint32_t root;
    } cases[] = {
#include "square_roots.h"
    };
    uint32_t wrong = 0;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        volatile float x;
        uint32_t bits;
        memcpy((void *)(uintptr_t)&x, &cases[i].x, sizeof bits);
        const float root = sqrtf(x);
        memcpy(&bits, &root, sizeof bits);
        wrong += (bits != cases[i].root) ? 1u : 0u;
    }
    report_number("cases", (uint32_t)(sizeof cases / sizeof cases[0]));
    report_number("wrong", wrong);
}

/* 'o': until there is no stack left. */
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 12
#pragma GCC diagnostic ignored "-Winfinite-recursion"
#endif
static __attribute__((noinline)) uint32_t overflow(volatile uint32_t depth)
{
    volatile uint32_t block[64];
    block[depth % 64u] = depth;
    return overflow(depth + 1u) + block[depth % 64u];
}

int main(void)
{
    pvid_port_init();
    report_text("ready\n");
    for (;;) {
        switch (next_byte()) {
        case 'e':
            echo();
            break;
        case 'c':
            count_instructions();
            break;
        case 'm':
            report_hex("initialised", initialised);
            report_hex("cleared", cleared);
            break;
        case 't':
            time_instructions();
            break;
        case 's':
            measure_stack();
            break;
        case 'r':
            square_roots();
            break;
        case 'o':
            (void)overflow(0u);
            break;
        case 'u':
#if defined(__AVR__)
            ((void (*)(void))0)(); /* the reset vector: started again */
#elif defined(__riscv)
            __asm__ volatile(".word 0");
#else
            __asm__ volatile("udf #0");
#endif
            break;
        case 'b':
            *(volatile uint32_t *)(uintptr_t)0x90000000u = 1u; /* no memory at the one or at the other */
            *(volatile uint32_t *)(uintptr_t)0x1F000000u = 1u;
            break;
        default: /* 'x': ends with the code that comes next */
            return next_byte();
        }
    }
}
