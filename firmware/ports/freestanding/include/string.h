/* The part of <string.h> that the core and the applications use, for boards without a C library. */
#ifndef PVID_FREESTANDING_STRING_H
#define PVID_FREESTANDING_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t n);
void *memmove(void *to, const void *from, size_t n);
void *memset(void *to, int byte, size_t n);
int memcmp(const void *a, const void *b, size_t n);
size_t strlen(const char *text);

#endif
