#include "number/uncontracted.h"

#include "solve/products_f32.h"

#include <stddef.h>

#include "number/count.h"
#include "number/exact.h"
#include "number/finite_f32.h"
#include "solve/pattern_f32.h"
#include "solve/row_f32.h"
#include "solve/state_f32.h"

float pvid_product_f32(const float x[], const float y[], size_t n)
{
    const size_t rows = PVID_COUNT(PVID_MAX_FUNCTIONS, n);
    float sum = 0.0f;
    PVID_UNROLL_EXACT
    for (size_t k = 0; k < rows; k++) {
        sum += x[k] * y[k];
    }
    return sum;
}

PVID_COLD pvid_reason pvid_products_accept_f32(pvid_estimator_f32 *self, size_t n, const float squares[], float rss)
{
    const float limit = PVID_ROW_LIMIT * PVID_ROW_LIMIT;
    bool fits = rss <= limit; /* NaN fails the comparison */
    bool finite = pvid_finite_f32(rss);
    for (size_t i = 0; i < n; i++) {
        fits = fits && (squares[i] <= limit);
        finite = finite && pvid_finite_f32(squares[i]);
    }
    if (fits) {
        return PVID_ACCUMULATED;
    }
    pvid_count_up(finite ? &self->counters.rejected_saturated : &self->counters.rejected_not_finite);
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

PVID_COLD void pvid_products_end_f32(pvid_estimator_f32 *self, const pvid_block *block, const float gradient[],
                                     float rss, uint32_t rows)
{
    const pvid_model_f32 *model = self->model;
    const float weight = self->information.row_weight * (float)rows;
    float *tail = &self->information.low[model->n_moments + model->n_theta];
    tail[0] += rss;
    tail[1] += weight;
    self->group_rss += rss;
    self->group_weight += weight;
    const uint32_t room = UINT32_MAX - self->counters.rows;
    self->counters.rows += (rows < room) ? rows : room;
    if (pvid_feeds_back_f32(self)) {
        float c[PVID_MAX_C];
        float innovation[PVID_MAX_P];
        model->jacobian(self->p, c);
        pvid_pattern_transpose_times_f32(model, c, block, gradient, innovation);
        pvid_row_accumulate_innovation_f32(self, model->n_p, innovation, 1.0f);
    }
}
