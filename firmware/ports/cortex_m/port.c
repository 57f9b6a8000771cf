/* Counter and exit of a Cortex-M; bytes go through the board's UART.
 *
 * The exit is a semihosting call, which an emulator or a debugger takes. On a board without either it is a
 * breakpoint that faults: define PVID_PORT_NO_SEMIHOSTING there and the exit waits for ever.
 */
#include "../port.h"
#include "../uart/uart.h"

#define SYSTICK_REGISTER(offset) (*(volatile uint32_t *)(uintptr_t)(0xE000E010u + (offset)))
#define CONTROL SYSTICK_REGISTER(0x0u)
#define RELOAD SYSTICK_REGISTER(0x4u)
#define VALUE SYSTICK_REGISTER(0x8u)
#define CONTROL_ENABLE_FROM_CORE_CLOCK 0x5u
#define LARGEST 0x00FFFFFFu

void pvid_port_init(void)
{
    pvid_uart_init();
    RELOAD = LARGEST;
    VALUE = 0u;
    CONTROL = CONTROL_ENABLE_FROM_CORE_CLOCK;
}

/* The 24 bits of SysTick, counted upwards, are the upper bits, so that differences modulo 2^32 are differences
 * modulo 2^24 of SysTick. */
uint32_t pvid_port_instructions(void)
{
    return (LARGEST - VALUE) << 8;
}

/* Under -icount shift=8 an instruction takes 256 ns of the emulator's time. */
uint32_t pvid_port_counts_per_1024(void)
{
    return (uint32_t)(((uint64_t)PVID_CLOCK_HZ * 67108864u + 500000000u) / 1000000000u);
}

#define COUNTS_PER_MICROSECOND (PVID_CLOCK_HZ / 1000000u)
#if (PVID_CLOCK_HZ % 1000000u) != 0u
#error "the clock must be whole MHz"
#endif

uint32_t pvid_port_microseconds(void)
{
    static uint32_t value = LARGEST; /* at the last call; SysTick counts down */
    static uint32_t rest;            /* counts that are no whole microsecond yet */
    static uint32_t time;
    const uint32_t now = VALUE;
    rest += (value - now) & LARGEST;
    value = now;
    time += rest / COUNTS_PER_MICROSECOND;
    rest %= COUNTS_PER_MICROSECOND;
    return time;
}

#if !defined(PVID_PORT_NO_SEMIHOSTING)
#define SYS_EXIT_EXTENDED 0x20u
#define APPLICATION_EXIT 0x20026u

static void semihosting_exit(int code)
{
    const uint32_t block[2] = {APPLICATION_EXIT, (uint32_t)code};
    register uint32_t operation __asm__("r0") = SYS_EXIT_EXTENDED;
    register const uint32_t *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : "+r"(operation) : "r"(argument) : "memory");
}
#else
static void semihosting_exit(int code)
{
    (void)code;
}
#endif

void pvid_port_exit(int code)
{
    pvid_uart_drain();
    semihosting_exit(code);
    for (;;) {
    }
}
