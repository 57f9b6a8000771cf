#include "fault.h"

#include "port.h"

/* A UART that never gets ready must not keep the report from ending. */
#define TRIES 1000000u

static void write_bytes(const uint8_t bytes[], size_t n)
{
    size_t sent = 0;
    for (uint32_t tries = 0; (sent < n) && (tries < TRIES); tries++) {
        sent += pvid_port_send(&bytes[sent], n - sent);
    }
}

static void write_text(const char *text)
{
    for (; *text != '\0'; text++) {
        const uint8_t byte = (uint8_t)*text;
        write_bytes(&byte, 1);
    }
}

void pvid_fault_begin(const char *what)
{
    pvid_port_init(); /* the fault may have occurred before the program's own call */
    write_text("\npvid fault: ");
    write_text(what);
}

void pvid_fault_word(const char *name, uint32_t word)
{
    write_text(" ");
    write_text(name);
    write_text(" 0x");
    for (uint32_t shift = 32; shift > 0u; shift -= 4u) {
        const uint8_t digit = (uint8_t)"0123456789abcdef"[(word >> (shift - 4u)) & 0xFu];
        write_bytes(&digit, 1);
    }
}

void pvid_fault_end(void)
{
    write_text("\n");
    pvid_port_exit(PVID_EXIT_FAULT);
}
