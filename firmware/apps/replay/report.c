#include "report.h"

#include <stddef.h>

#include "port.h"

#define DIGITS 10u /* of 2^32 - 1 */

void report_text(const char *text)
{
    while (*text != '\0') {
        const uint8_t byte = (uint8_t)*text;
        if (pvid_port_send(&byte, 1) == 1u) {
            text++;
        }
    }
}

static void report_digits(uint32_t value, uint32_t base, uint32_t least)
{
    char digits[DIGITS + 1u];
    size_t place = DIGITS;
    digits[place] = '\0';
    while ((place > 0u) && ((value != 0u) || (place > (DIGITS - least)))) {
        place--;
        digits[place] = "0123456789abcdef"[value % base];
        value /= base;
    }
    report_text(&digits[place]);
}

void report_number(const char *name, uint32_t value)
{
    report_text(name);
    report_text(" ");
    report_digits(value, 10u, 1u);
    report_text("\n");
}

void report_hex(const char *name, uint32_t value)
{
    report_text(name);
    report_text(" ");
    report_digits(value, 16u, 8u);
    report_text("\n");
}

void report_hash_at(uint32_t ticks, uint32_t hash)
{
    report_text("at ");
    report_digits(ticks, 10u, 1u);
    report_text(" ");
    report_digits(hash, 16u, 8u);
    report_text("\n");
}
