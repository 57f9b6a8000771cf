#include "judge/misfit_q31.h"

#include <stddef.h>

#include "number/integer_q31.h"
#include "pvid/config.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"

#define BLOCK_S 4u           /* PVID_MISFIT_BLOCK_S */
#define ROWS_MAX 65535u      /* of a block */
#define SENSITIVITY_SHIFT 3u /* a sensitivity within 2^31 then has a square like that of a residual */
#define SENSITIVITY_LIMIT ((int32_t)1 << 28)
#define SQUARE_LIMIT ((int64_t)1 << 56)

/* Of q: PVID_MISFIT_MOST, PVID_MISFIT_LEAST; and PVID_MISFIT_TIMES. */
static const pvid_scaled_q31 most = {549755814, -37};
static const pvid_scaled_q31 least = {703687442, -45};
static const pvid_scaled_q31 times = {(int32_t)3 << 28, -28};

/* 2^120, of the quietest block while there is none: beyond any. */
static const pvid_scaled_q31 unknown = {(int32_t)1 << 29, 91};
static const pvid_scaled_q31 growth_max = {(int32_t)1 << 29, -28};

static void begin_block(pvid_misfit_q31 *self)
{
    const pvid_scaled_q31 nothing = {0, 0};
    self->rss = nothing;
    self->signal = nothing;
    self->left = self->block;
}

/* The quietest block is forgotten four times as slowly as the sums: in a block of four seconds it grows by one
 * second over the time constant. */
PVID_COLD void pvid_misfit_init_q31(pvid_misfit_q31 *self, uint32_t drive_ticks, uint32_t forgetting_groups)
{
    PVID_ASSERT(self != NULL);
    self->growth = pvid_scaled_of_q31(1, 0);
    if (forgetting_groups > 0u) {
        const pvid_scaled_q31 second = pvid_scaled_of_q31(drive_ticks, 0);
        const pvid_scaled_q31 part = pvid_scaled_over_q31(second, pvid_scaled_of_q31(forgetting_groups, 0));
        const pvid_scaled_q31 growth = pvid_scaled_plus_q31(self->growth, part);
        self->growth = pvid_scaled_exceeds_q31(growth, growth_max) ? growth_max : growth;
    }
    self->few_rss = 0;
    self->few_signal = 0;
    self->least_rss = unknown;
    self->least_part = unknown;
    self->block = (uint16_t)((drive_ticks <= (ROWS_MAX / BLOCK_S)) ? (BLOCK_S * drive_ticks) : ROWS_MAX);
    begin_block(self);
}

int64_t pvid_misfit_signal_q31(int64_t sensitivity)
{
    return pvid_square_q31(
        (int32_t)pvid_clamp_q31(pvid_round_shift_q31(sensitivity, SENSITIVITY_SHIFT), SENSITIVITY_LIMIT));
}

bool pvid_misfit_add_q31(pvid_misfit_q31 *self, int64_t square, int64_t signal)
{
    self->few_rss += (square < SQUARE_LIMIT) ? square : SQUARE_LIMIT;
    self->few_signal += (signal < SQUARE_LIMIT) ? signal : SQUARE_LIMIT;
    self->left--;
    if ((self->left % PVID_MISFIT_FEW) == 0u) {
        self->rss = pvid_scaled_plus_q31(self->rss, pvid_scaled_of_q31(self->few_rss, 0));
        self->signal =
            pvid_scaled_plus_q31(self->signal, pvid_scaled_of_q31(self->few_signal, 2 * (int32_t)SENSITIVITY_SHIFT));
        self->few_rss = 0;
        self->few_signal = 0;
    }
    return self->left == 0u;
}

/* The minimum so far times growth, or the new value if it is smaller. */
static pvid_scaled_q31 least_of(pvid_scaled_q31 so_far, pvid_scaled_q31 growth, pvid_scaled_q31 now)
{
    const pvid_scaled_q31 grown = pvid_scaled_times_q31(so_far, growth);
    const pvid_scaled_q31 risen = pvid_scaled_exceeds_q31(grown, unknown) ? unknown : grown;
    return pvid_scaled_exceeds_q31(risen, now) ? now : risen;
}

static bool is_larger(const pvid_misfit_q31 *self, pvid_scaled_q31 part)
{
    return pvid_scaled_exceeds_q31(self->rss, pvid_scaled_times_q31(times, self->least_rss)) &&
           pvid_scaled_exceeds_q31(part, pvid_scaled_times_q31(times, self->least_part)) &&
           pvid_scaled_exceeds_q31(part, least);
}

bool pvid_misfit_judge_q31(pvid_misfit_q31 *self)
{
    PVID_ASSERT(self != NULL);
    bool misfit = false;
    if (self->signal.m > 0) {
        const pvid_scaled_q31 part = pvid_scaled_over_q31(self->rss, self->signal);
        const bool has_reference = pvid_scaled_exceeds_q31(unknown, self->least_part);
        misfit = has_reference && (is_larger(self, part) || pvid_scaled_exceeds_q31(part, most));
        self->least_rss = least_of(self->least_rss, self->growth, self->rss);
        self->least_part = least_of(self->least_part, self->growth, part);
    }
    begin_block(self);
    return misfit;
}
