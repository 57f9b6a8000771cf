/* Whether a float is finite, by its bits: fast-math builds may remove isfinite of <math.h>. */
#ifndef PVID_FINITE_F32_H
#define PVID_FINITE_F32_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* Least positive normal number. */
#define PVID_LEAST_NORMAL_F32 1.17549435e-38f

static inline uint32_t pvid_bits_f32(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline float pvid_from_bits_f32(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static inline bool pvid_finite_f32(float x)
{
    return (pvid_bits_f32(x) & 0x7F800000u) != 0x7F800000u;
}

/* Finite and low <= x <= high: the check of a setting. */
bool pvid_within_f32(float x, float low, float high);

#endif
