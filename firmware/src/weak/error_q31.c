/* The rule of error_f32.c. Shares are known in windows alone that compute the noise anew: in another one a variance
 * that is to be changed waits for the next. */
#include "weak/error_q31.h"

#include "number/scaled_q31.h"
#include "number/unroll.h"

/* Windows in the mean: the fewest that change the variance, and the most. */
#define FEWEST 4u
#define MOST 16u

#define MEAN_BITS 8 /* after the point */
#define ONE ((int32_t)1 << MEAN_BITS)
#define MEAN_MAX ((int32_t)1 << 29)

/* Means that change the variance. */
#define RISES (10 * ONE)
#define FALLS (ONE / 4)

/* A window below or above these parts of the mean begins a new one. */
#define FAR 5

/* Largest exponent of a variance. */
#define EXPONENT_MAX 1000

PVID_COLD void pvid_weak_error_init_q31(pvid_weak_error_q31 self[], const pvid_weak_design_q31 *design)
{
    for (size_t kind = 0; kind < design->model->kinds; kind++) {
        self[kind].variance = design->error_variance[kind];
        self[kind].mean = 0;
        self[kind].windows = 0;
    }
}

/* Whether the variance is to be changed. */
static bool changes(const pvid_weak_error_q31 *self, pvid_scaled_q31 least)
{
    const bool falls = (self->mean < FALLS) && pvid_scaled_exceeds_q31(self->variance, least);
    return (self->windows >= FEWEST) && ((self->mean > RISES) || falls);
}

PVID_COLD bool pvid_weak_error_take_q31(pvid_weak_error_q31 *self, pvid_scaled_q31 least, pvid_scaled_q31 residual)
{
    const int32_t own = (int32_t)pvid_clamp_q31(pvid_scaled_fixed_q31(residual, MEAN_BITS), MEAN_MAX);
    if ((((int64_t)own * FAR) < self->mean) || (own > ((int64_t)self->mean * FAR))) {
        self->windows = 0;
    }
    self->mean += (2 * (own - self->mean)) / ((int32_t)self->windows + 2);
    if (self->windows < MOST) {
        self->windows++;
    }
    return changes(self, least);
}

PVID_COLD int32_t pvid_weak_error_change_q31(pvid_weak_error_q31 *self, pvid_scaled_q31 least, pvid_scaled_q31 share)
{
    if (!changes(self, least) || (share.m <= 0)) {
        return INT32_MAX;
    }
    const pvid_scaled_q31 excess = pvid_scaled_of_q31((int64_t)self->mean - ONE, -MEAN_BITS);
    const pvid_scaled_q31 found = pvid_scaled_plus_q31(self->variance, pvid_scaled_over_q31(excess, share));
    if (found.e > EXPONENT_MAX) {
        return INT32_MAX;
    }
    const int32_t left =
        (self->mean > RISES) ? (int32_t)pvid_quotient_q31((uint64_t)ONE << 31, (uint32_t)self->mean) : INT32_MAX;
    self->variance = pvid_scaled_exceeds_q31(found, least) ? found : least;
    self->windows = 0;
    return left;
}
