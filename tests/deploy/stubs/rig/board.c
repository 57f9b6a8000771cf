/* Starts bits.c on a board and counts the instructions of the commissioning's tick and of its background. */
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

#include "port.h"
#include "pvid/commission.h"

int measured(void);

typedef struct {
    uint32_t calls;
    uint32_t most;
    uint32_t sum; /* of instructions / 16 */
} cost;

static cost of_step;
static cost of_work;

pvid_commission_state __real_pvid_commission_step_f32(pvid_commission_f32 *self, const float sample[], float drive[]);
bool __real_pvid_commission_work_f32(pvid_commission_f32 *self);
pvid_commission_state __wrap_pvid_commission_step_f32(pvid_commission_f32 *self, const float sample[], float drive[]);
bool __wrap_pvid_commission_work_f32(pvid_commission_f32 *self);

static void count(cost *one, uint32_t before)
{
    const uint64_t counts = pvid_port_instructions() - before;
    const uint32_t instructions = (uint32_t)((counts * 1024u) / pvid_port_counts_per_1024());
    one->calls++;
    one->most = (instructions > one->most) ? instructions : one->most;
    one->sum += instructions / 16u;
}

pvid_commission_state __wrap_pvid_commission_step_f32(pvid_commission_f32 *self, const float sample[], float drive[])
{
    const uint32_t before = pvid_port_instructions();
    const pvid_commission_state state = __real_pvid_commission_step_f32(self, sample, drive);
    count(&of_step, before);
    return state;
}

bool __wrap_pvid_commission_work_f32(pvid_commission_f32 *self)
{
    const uint32_t before = pvid_port_instructions();
    const bool more = __real_pvid_commission_work_f32(self);
    count(&of_work, before);
    return more;
}

static void show(const char *what, const cost *one)
{
    printf("%s: mean %lu, longest %lu instructions\n", what, (unsigned long)((16u * one->sum) / one->calls),
           (unsigned long)one->most);
}

int main(void)
{
    pvid_port_init();
    const int code = measured();
    show("step", &of_step);
    show("work", &of_work);
    printf("stack %lu bytes\n", (unsigned long)pvid_port_stack_used());
    pvid_port_exit(code);
}

/* ---- %d, %ld, %03ld, %lu, %s ---- */

static void send(char c)
{
    const uint8_t byte = (uint8_t)c;
    while (pvid_port_send(&byte, 1u) == 0u) {
    }
}

static void send_number(unsigned long x, int digits)
{
    if ((x >= 10u) || (digits > 1)) {
        send_number(x / 10u, digits - 1);
    }
    send((char)('0' + (char)(x % 10u)));
}

int printf(const char *format, ...)
{
    va_list given;
    va_start(given, format);
    for (; *format != '\0'; format++) {
        if (*format != '%') {
            send(*format);
            continue;
        }
        int digits = 1;
        bool is_long = false;
        for (format++; (*format == 'l') || ((*format >= '0') && (*format <= '9')); format++) {
            is_long = is_long || (*format == 'l');
            digits = (*format == 'l') ? digits : (*format - '0');
        }
        if (*format == 's') {
            for (const char *text = va_arg(given, const char *); *text != '\0'; text++) {
                send(*text);
            }
        } else if (*format == 'u') {
            send_number(va_arg(given, unsigned long), digits);
        } else {
            const long x = is_long ? va_arg(given, long) : (long)va_arg(given, int);
            if (x < 0) {
                send('-');
            }
            send_number((x < 0) ? (0uL - (unsigned long)x) : (unsigned long)x, digits);
        }
    }
    va_end(given);
    return 0;
}
