#include "solve/row_q31.h"

#include <stddef.h>

#include "number/count.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "solve/information_q31.h"
#include "solve/scaled_model_q31.h"

#define TERM_MAX ((int64_t)1 << 40) /* of N_i theta_i, far beyond the limit of a row */
#define TERM_DOWN 18                /* a shift that brings a row's limit times 30 bits there */

void pvid_estimator_theta_q31(const pvid_estimator_q31 *self, const int32_t p[], int64_t theta[])
{
    const pvid_model_q31 *model = self->model;
    if (model->scaled != NULL) {
        model->scaled->adapter->theta(self, p, theta);
    } else {
        model->theta(p, theta);
    }
}

void pvid_estimator_set_theta_q31(pvid_estimator_q31 *self, const int64_t theta[])
{
    for (size_t i = 0; i < self->model->n_theta; i++) {
        const pvid_scaled_q31 clamped = pvid_scaled_of_q31(theta[i], 0);
        self->theta[i] = theta[i];
        self->mantissa[i] = clamped.m;
        self->shift[i] = (int16_t)(self->align[i] - clamped.e);
    }
}

/* x 2^-shift within +-TERM_MAX, |x| <= 2^58. */
static int64_t term_of(int64_t x, int32_t shift)
{
    return (shift >= TERM_DOWN) ? pvid_round_shift_q31(x, (uint32_t)shift)
                                : pvid_clamp_q31(pvid_scale_q31(x, shift), TERM_MAX);
}

bool pvid_estimator_terms_q31(const pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[], int32_t y,
                              int64_t term[], int64_t *e)
{
    const int32_t *mantissa = &self->mantissa[block->first];
    const int16_t *shift = &self->shift[block->first];
    bool fits = (y >= -PVID_ROW_LIMIT_Q31) && (y <= PVID_ROW_LIMIT_Q31);
    int64_t rest = y;
    for (size_t i = 0; i < block->n; i++) {
        fits = fits && (n[i] >= -PVID_ROW_LIMIT_Q31) && (n[i] <= PVID_ROW_LIMIT_Q31);
        const int32_t below = (n[i] > PVID_ROW_LIMIT_Q31) ? PVID_ROW_LIMIT_Q31 : n[i];
        const int32_t clamped = (below < -PVID_ROW_LIMIT_Q31) ? -PVID_ROW_LIMIT_Q31 : below;
        term[i] = term_of(pvid_short_product_q31(clamped, mantissa[i]), shift[i]);
        rest -= term[i];
    }
    *e = rest;
    return fits && (*e >= -PVID_ROW_LIMIT_Q31) && (*e <= PVID_ROW_LIMIT_Q31);
}

bool pvid_estimator_innovation_q31(const pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[],
                                   int32_t y, int64_t *e)
{
    int64_t term[PVID_MAX_THETA_Q31];
    return pvid_estimator_terms_q31(self, block, n, y, term, e);
}

void pvid_estimator_add_row_q31(pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[], int32_t e,
                                int64_t square)
{
    self->group_rss = pvid_clamp_q31(self->group_rss + square, PVID_WIDE);
    self->group_weight = pvid_clamp_q31(self->group_weight + self->information.row_weight, PVID_WIDE);
    pvid_information_add_q31(&self->information, block, n, e, self->fresh);
    pvid_count_up(&self->counters.rows);
}

void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance)
{
    const int64_t weight = self->information.sums[self->information.n_sums - 1u];
    if ((self->group_weight <= 0) || (weight < self->group_weight)) {
        return;
    }
    const pvid_scaled_q31 share =
        pvid_scaled_over_q31(pvid_scaled_of_q31(self->group_weight, 0), pvid_scaled_of_q31(weight, 0));
    const pvid_scaled_q31 change = pvid_scaled_times_q31(share, pvid_scaled_minus_q31(variance, self->expected));
    const pvid_scaled_q31 mean = pvid_scaled_plus_q31(self->expected, change);
    self->expected.m = (mean.m > 0) ? mean.m : 0;
    self->expected.e = mean.e;
}
