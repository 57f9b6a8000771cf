/* Starts firmware/examples/commission.c on a board and counts the instructions of its tick and of its background. */
#include <stdbool.h>
#include <stdio.h>

#include "port.h"
#include "pvid/commission.h"

int program(void);

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
    const int code = program();
    show("step", &of_step);
    show("work", &of_work);
    printf("stack %lu bytes\n", (unsigned long)pvid_port_stack_used());
    pvid_port_exit(code);
}
