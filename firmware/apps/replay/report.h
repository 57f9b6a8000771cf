/* Lines of text `name value` over the port. Each function waits until its line is on the way. */
#ifndef REPORT_H
#define REPORT_H

#include <stdint.h>

void report_text(const char *text);

/* "name 1234\n" */
void report_number(const char *name, uint32_t value);

/* "name 0000abcd\n" */
void report_hex(const char *name, uint32_t value);

/* "at 500 0000abcd\n": the running hash after so many ticks */
void report_hash_at(uint32_t ticks, uint32_t hash);

#endif
