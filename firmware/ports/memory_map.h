/* Addresses that the linker script fixes. Objects that are never read: only their addresses matter. */
#ifndef PVID_MEMORY_MAP_H
#define PVID_MEMORY_MAP_H

#include <stdint.h>

extern uint32_t pvid_stack_guard[];  /* below the stack: write-protected */
extern uint32_t pvid_stack_bottom[]; /* the lowest word */
extern uint32_t pvid_stack_top[];
extern const uint32_t pvid_data_load[]; /* the initial values of .data in the image */
extern uint32_t pvid_data_start[];
extern uint32_t pvid_data_end[];
extern uint32_t pvid_bss_start[];
extern uint32_t pvid_bss_end[];

/* What the stack is painted with. */
#define PVID_PAINT 0xC5A3C5A3u

#endif
