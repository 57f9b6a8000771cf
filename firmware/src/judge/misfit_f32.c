#include "number/uncontracted.h"

#include "judge/misfit_f32.h"

#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/config.h"

#define UNKNOWN 1.0e35f   /* least_rss and least_part before the first block: above any block's */
#define ROWS_MAX 65535.0f /* most rows of a block */
#define GROWTH_MAX 2.0f   /* largest growth per block */

/* least_rss and least_part are forgotten four times as slowly as the sums. */
#define SLOWER 4.0f

PVID_COLD void pvid_misfit_init_f32(pvid_misfit_f32 *self, float rate_hz, float forgetting_s)
{
    PVID_ASSERT(self != NULL);
    const float rows = PVID_MISFIT_BLOCK_S * rate_hz;
    const float growth = (forgetting_s > 0.0f) ? (1.0f + (PVID_MISFIT_BLOCK_S / (SLOWER * forgetting_s))) : 1.0f;
    self->growth = (growth < GROWTH_MAX) ? growth : GROWTH_MAX;
    self->rss = 0.0f;
    self->signal = 0.0f;
    self->least_rss = UNKNOWN;
    self->least_part = UNKNOWN;
    self->block = (uint16_t)((rows < 1.0f) ? 1.0f : ((rows < ROWS_MAX) ? rows : ROWS_MAX));
    self->left = self->block;
}

/* The minimum so far times growth, or the new value if it is smaller. */
static float least_of(float least, float growth, float now)
{
    const float grown = least * growth;
    const float risen = (grown < UNKNOWN) ? grown : UNKNOWN;
    return (now < risen) ? now : risen;
}

PVID_COLD bool pvid_misfit_judge_f32(pvid_misfit_f32 *self)
{
    PVID_ASSERT(self != NULL);
    bool misfit = false;
    if (!pvid_finite_f32(self->rss + self->signal)) {
        misfit = true;
    } else if (self->signal > 0.0f) {
        const float part = self->rss / self->signal;
        const bool has_reference = self->least_part < UNKNOWN;
        const bool larger = (self->rss > (PVID_MISFIT_TIMES * self->least_rss)) &&
                            (part > (PVID_MISFIT_TIMES * self->least_part)) && (part > PVID_MISFIT_LEAST);
        misfit = has_reference && (larger || (part > PVID_MISFIT_MOST));
        self->least_rss = least_of(self->least_rss, self->growth, self->rss);
        self->least_part = least_of(self->least_part, self->growth, part);
    }
    self->rss = 0.0f;
    self->signal = 0.0f;
    self->left = self->block;
    return misfit;
}
