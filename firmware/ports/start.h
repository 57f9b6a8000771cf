/* The part of a start that Cortex-M and RISC-V share, once the stack pointer is set. */
#ifndef PVID_START_H
#define PVID_START_H

#include <stdint.h>

/* Paints the stack up to `top_of_rest`, fills .data, clears .bss, runs main and exits with its result. */
#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void pvid_start(uint32_t *top_of_rest);

#endif
