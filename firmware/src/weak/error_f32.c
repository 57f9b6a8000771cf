#include "number/uncontracted.h"

/* White rows have the mean square 1 if the sensors' noise and an error v of the equation itself explain their residuals
 * (white_f32.c). If the mean square r of the last windows is far from it, then
 *
 *   v + (r - 1) / (Q_m / K)
 *
 * is used from the next window on, but never less than the design's variance. Where r was too large, the older rows are
 * wrongly weighted, some of their directions as if they were exact: they are to count no more. */
#include "weak/error_f32.h"

#include <stdbool.h>
#include <stddef.h>

#include "number/unroll.h"

/* Windows in the mean: the fewest that change v, and the most. */
#define FEWEST 4u
#define MOST 16u

/* Means that change v. A variance that is wrong by less costs less than to begin anew. */
#define RISES 10.0f
#define FALLS 0.25f

/* A window below or above these parts of the mean begins a new one: a motion that the equations describe badly, or a p
 * on its way, has residuals of all sizes. By chance two mean squares of 9 residuals are that far apart once in 40. */
#define FAR_BELOW 0.2f
#define FAR_ABOVE 5.0f

/* Largest v: its share in D_h is finite. */
#define VARIANCE_MAX 1.0e30f

PVID_COLD void pvid_weak_error_init_f32(pvid_weak_error_f32 self[], const pvid_weak_design_f32 *design)
{
    for (size_t kind = 0; kind < design->model->kinds; kind++) {
        self[kind].variance = design->error_variance[kind];
        self[kind].mean = 0.0f;
        self[kind].windows = 0;
    }
}

/* Returns whether there are enough windows in the mean. */
static bool add_to_mean(pvid_weak_error_f32 *self, float residual)
{
    if ((residual < (FAR_BELOW * self->mean)) || (residual > (FAR_ABOVE * self->mean))) {
        self->windows = 0;
    }
    self->mean += (2.0f / ((float)self->windows + 2.0f)) * (residual - self->mean);
    if (self->windows < MOST) {
        self->windows++;
    }
    return self->windows >= FEWEST;
}

PVID_COLD float pvid_weak_error_take_f32(pvid_weak_error_f32 *self, float least, float residual, float share)
{
    const bool known = add_to_mean(self, residual);
    const bool rises = known && (self->mean > RISES);
    const bool falls = known && (self->mean < FALLS) && (self->variance > least);
    const float found = self->variance + ((self->mean - 1.0f) / share);
    if ((!rises && !falls) || !(found <= VARIANCE_MAX)) {
        return 1.0f;
    }
    self->variance = (found > least) ? found : least;
    self->windows = 0;
    return rises ? (1.0f / self->mean) : 1.0f;
}
