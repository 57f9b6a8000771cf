#include "start.h"

#include "memory_map.h"
#include "port.h"

int main(void);

/* Volatile: no call of memset or memcpy, whose frames would be in the painted area. */
static void fill(volatile uint32_t *from, const volatile uint32_t *end, uint32_t word)
{
    const size_t words = ((uintptr_t)end - (uintptr_t)from) / sizeof word;
    for (size_t i = 0; i < words; i++) {
        from[i] = word;
    }
}

void pvid_start(uint32_t *top_of_rest)
{
    fill(pvid_stack_bottom, top_of_rest, PVID_PAINT);
    fill(pvid_bss_start, pvid_bss_end, 0u);
    const volatile uint32_t *source = pvid_data_load;
    volatile uint32_t *target = pvid_data_start;
    const size_t words = ((uintptr_t)pvid_data_end - (uintptr_t)pvid_data_start) / sizeof *target;
    for (size_t i = 0; i < words; i++) {
        target[i] = source[i];
    }
    pvid_port_exit(main());
}

size_t pvid_port_stack_size(void)
{
    return (size_t)((uintptr_t)pvid_stack_top - (uintptr_t)pvid_stack_bottom);
}

size_t pvid_port_stack_used(void)
{
    const volatile uint32_t *word = pvid_stack_bottom;
    while (((uintptr_t)word < (uintptr_t)pvid_stack_top) && (*word == PVID_PAINT)) {
        word++;
    }
    return (size_t)((uintptr_t)pvid_stack_top - (uintptr_t)word);
}
