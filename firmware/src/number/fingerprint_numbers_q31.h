/* Hashes of integers of a configuration, continued from `hash`: its owner lists them. Private to the core. */
#ifndef PVID_FINGERPRINT_NUMBERS_Q31_H
#define PVID_FINGERPRINT_NUMBERS_Q31_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"

uint32_t pvid_fingerprint_words(uint32_t hash, const int32_t values[], size_t n);
uint32_t pvid_fingerprint_formats(uint32_t hash, const int8_t values[], size_t n);

/* Tables may be in their own address space. */
uint32_t pvid_fingerprint_table(uint32_t hash, const PVID_TABLE int32_t *values, size_t n);

#endif
