/* Hashes of numbers of a configuration, continued from `hash`: its owner lists them. Private to the core. */
#ifndef PVID_FINGERPRINT_NUMBERS_F32_H
#define PVID_FINGERPRINT_NUMBERS_F32_H

#include <stddef.h>
#include <stdint.h>

/* The bits of numbers; those of a configuration that init accepts are finite. */
uint32_t pvid_fingerprint_float(uint32_t hash, float value);
uint32_t pvid_fingerprint_floats(uint32_t hash, const float values[], size_t n);

#endif
