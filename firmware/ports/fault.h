/* Output of a board's fault handler: over the UART, and the exit code of the emulator. */
#ifndef PVID_FAULT_H
#define PVID_FAULT_H

#include <stdint.h>

/* Exit code of a program that ended in a fault. */
#define PVID_EXIT_FAULT 112

/* Starts the report: a new line, "pvid fault: " and the event. */
void pvid_fault_begin(const char *what);

/* Adds " name 0x........" to it. */
void pvid_fault_word(const char *name, uint32_t word);

/* Ends it and the program. */
#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void pvid_fault_end(void);

#endif
