/* Sine and cosine together, inlined: short where |x| is below pi/4. Private to the core; the same bits everywhere. */
#ifndef PVID_SINCOS_F32_H
#define PVID_SINCOS_F32_H

#include <stdint.h>

#include "number/finite_f32.h"
#include "number/unroll.h"

/* Error < 6e-8 + 4e-8 turns; of |x| above 1e5 any number in -2..2, of NaN NaN. */
PVID_ALWAYS_INLINE void pvid_sincos_f32(float x, float *sine, float *cosine)
{
    uint32_t quarter = 0;
    float r = x;
    if ((x > 0.7854f) || (x < -0.7854f)) {
        const float magic = 12582912.0f; /* adding and subtracting it rounds to the nearest integer */
        const float sum = (x * 0.636619772f) + magic;
        const float turns = sum - magic;
        quarter = pvid_bits_f32(sum) & 3u;
        r = (x - (turns * 1.5703125f)) - (turns * 4.83826797e-4f);
    }
    const float z = r * r;
    const float s = r + ((r * z) * (-1.66666546e-1f + (z * (8.33216087e-3f - (z * 1.95152959e-4f)))));
    const float c = 1.0f + (z * (-0.5f + (z * (4.16666456e-2f + (z * (-1.38873163e-3f + (z * 2.44331571e-5f)))))));
    const float a = ((quarter & 1u) != 0u) ? c : s;
    const float b = ((quarter & 1u) != 0u) ? -s : c;
    *sine = ((quarter & 2u) != 0u) ? -a : a;
    *cosine = ((quarter & 2u) != 0u) ? -b : b;
}

#endif
