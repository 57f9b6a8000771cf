/* Counter and exit of QEMU's RISC-V board; bytes go through its UART. With PVID_COUNTS_CYCLES the counter is that of
 * clock cycles, which runs on a core from when it is allowed to. */
#include "../port.h"
#include "../uart/uart.h"

/* The device with which QEMU's `virt` is switched off. A board of your own: wait for ever. */
#define TEST_FINISHER (*(volatile uint32_t *)(uintptr_t)0x100000u)
#define FINISHER_PASS 0x5555u
#define FINISHER_FAIL 0x3333u

#if defined(PVID_COUNTS_CYCLES)
#define COUNTER "mcycle"
#else
#define COUNTER "minstret"
#endif

void pvid_port_init(void)
{
    pvid_uart_init();
#if defined(PVID_COUNTS_CYCLES)
    __asm__ volatile(".option push\n\t.option arch, +zicsr\n\tcsrw 0x320, zero\n\t.option pop"); /* mcountinhibit */
#endif
}

uint32_t pvid_port_instructions(void)
{
    uint32_t count;
    __asm__ volatile(".option push\n\t.option arch, +zicsr\n\tcsrr %0, " COUNTER "\n\t.option pop" : "=r"(count));
    return count;
}

uint32_t pvid_port_counts_per_1024(void)
{
    return 1024u;
}

/* The machine timer of `virt`, 10 MHz. */
#define MTIME_LOW (*(volatile uint32_t *)(uintptr_t)0x0200BFF8u)
#define COUNTS_PER_MICROSECOND 10u

uint32_t pvid_port_microseconds(void)
{
    static uint32_t value;
    static uint32_t rest;
    static uint32_t time;
    const uint32_t now = MTIME_LOW;
    rest += now - value;
    value = now;
    time += rest / COUNTS_PER_MICROSECOND;
    rest %= COUNTS_PER_MICROSECOND;
    return time;
}

void pvid_port_exit(int code)
{
    pvid_uart_drain();
    TEST_FINISHER = (code == 0) ? FINISHER_PASS : (((uint32_t)code << 16) | FINISHER_FAIL);
    for (;;) {
    }
}
