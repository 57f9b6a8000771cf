/* pvid/differentiator.h - derivatives of order 0 to 4 of one sampled channel.
 *
 * A window of 2 * half * stride + 1 points and a bank of five symmetric FIR filters: central finite differences with a
 * stride, Savitzky-Golay of any degree, or your own table. All orders refer to the centre of the window. Never
 * allocates; the time of a step does not depend on the data.
 *
 * Long windows: a point is the mean of `block` samples, and there is one result for each block. 35 points cover a
 * window of any length in 35 places, at the cost of 35 taps a block and one addition a sample: O(1) a sample. The noise
 * is that of the polynomial through all samples plus 2 % (order 0) to 14 % (order 4). Every sum of a block begins anew,
 * so that no rounding adds up over a run.
 *
 *   pvid_differentiator_f32 phi;                              (static)
 *   if (pvid_differentiator_init_f32(&phi, &bank, 1000.0f) != PVID_OK) ...
 *   float d[PVID_ORDERS];
 *   if (pvid_differentiator_step_f32(&phi, sample, d)) use d[0] .. d[4];
 *
 * Not thread-safe; one object per channel. `pvid tables --form fir` prints tables.
 */
#ifndef PVID_DIFFERENTIATOR_H
#define PVID_DIFFERENTIATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/layout.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A bank in folded form. With x[0] the centre point and x[+-i] those i * stride points away,
 *   q_i = (x[i] - x[0]) + (x[-i] - x[0]),   d_i = x[i] - x[-i],   i = 1..half,
 *   order 0:      x[0] + sum w[0][i-1] q_i
 *   orders 2, 4:  rate^k sum w[k][i-1] q_i        rate = sample rate / (stride block)
 *   orders 1, 3:  rate^k sum w[k][i-1] d_i
 *
 * A constant is reproduced exactly for any rounding of the weights, and the large common part of the readings
 * enters no product. */
typedef struct {
    uint16_t half;        /* taps on each side, >= 2; 2 half stride + 1 <= PVID_MAX_WINDOW */
    uint16_t stride;      /* points from tap to tap, >= 1 */
    const float *weights; /* [PVID_ORDERS][half], order k in units of 1/(stride points)^k; kept by reference */
    uint16_t block;       /* samples of a point; 0 and 1: the sample itself */
} pvid_fir_bank_f32;

/* Central differences on five points: errors of order h^4 (orders 0, 1, 2) and h^2 (3, 4). */
extern const float pvid_five_points_f32[PVID_ORDERS * 2];

/* State: detail/differentiator_state.h, not API. Only the functions below write to it. */
typedef struct pvid_differentiator_f32 pvid_differentiator_f32;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_differentiator_init_layout_f32(pvid_differentiator_f32 *self, const pvid_fir_bank_f32 *bank,
                                                float sample_rate_hz, uint32_t layout);

/* Initialises `self` for samples at sample_rate_hz [Hz]. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged),
 *   - half or stride is out of its range (PVID_BAD_HALF, PVID_BAD_STRIDE),
 *   - a weight is not finite (PVID_BAD_BANK), or
 *   - the rate is not in 1e-3..1e6 Hz (PVID_BAD_SAMPLE_RATE). */
static inline pvid_status pvid_differentiator_init_f32(pvid_differentiator_f32 *self, const pvid_fir_bank_f32 *bank,
                                                       float sample_rate_hz)
{
    return pvid_differentiator_init_layout_f32(self, bank, sample_rate_hz, PVID_LAYOUT);
}

/* Empties the window; call it after a gap, when samples are no longer equidistant. */
void pvid_differentiator_reset_f32(pvid_differentiator_f32 *self);

/* Adds a finite sample. When it completes a point and the window is full, writes the derivatives out[k] [unit/s^k] and
 * returns true. Cost then: 5 half multiplications; else an addition. */
bool pvid_differentiator_step_f32(pvid_differentiator_f32 *self, float sample, float out[PVID_ORDERS]);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/differentiator_state.h"

#endif
