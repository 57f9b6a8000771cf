#include "number/uncontracted.h"

#include "solve/drift_f32.h"

#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "solve/information_f32.h"
#include "solve/pattern_f32.h"

#if PVID_MAX_DRIFTS > 0

/* One block of M forgets along a direction of theta, given of_m = M direction. */
static void forget_block(pvid_estimator_f32 *self, const pvid_block *block, const float sums[], const float direction[],
                         const float of_m[])
{
    const size_t moments = self->model->n_moments;
    const size_t first = block->first;
    float *low = self->information.low;
    float known = 0.0f;
    float force = 0.0f;
    for (size_t i = first; i < first + block->n; i++) {
        known += direction[i] * of_m[i];
        force += direction[i] * sums[moments + i];
    }
    const float lost = (1.0f - self->settings.drift_keep) / known;
    if (!(known >= PVID_LEAST_NORMAL_F32) || !pvid_finite_f32(lost * (force * force))) {
        return;
    }
    float *entry = &low[block->moment];
    for (size_t i = first; i < first + block->n; i++) {
        const float share = lost * of_m[i];
        for (size_t j = i; j < first + block->n; j++) {
            *entry -= share * of_m[j];
            entry++;
        }
        low[moments + i] -= share * force;
    }
    low[moments + self->model->n_theta] -= lost * (force * force);
}

static void forget_along(pvid_estimator_f32 *self, const float direction[])
{
    const pvid_model_f32 *model = self->model;
    float sums[PVID_MAX_SUMS];
    float of_m[PVID_MAX_THETA] = {0.0f};
    pvid_block block;
    pvid_information_read_f32(&self->information, sums);
    for (size_t i = 0; i < model->n_theta; i++) {
        pvid_pattern_add_column_f32(model, i, direction[i], sums, of_m);
    }
    for (size_t i = 0; i < model->n_theta; i = (size_t)block.first + block.n) {
        pvid_information_block_f32(model, i, &block);
        forget_block(self, &block, sums, direction, of_m);
    }
}

PVID_COLD void pvid_drift_forget_f32(pvid_estimator_f32 *self)
{
    const pvid_model_f32 *model = self->model;
    if (model->n_drifts == 0u) {
        return;
    }
    float c[PVID_MAX_C];
    float d[PVID_MAX_DRIFTS * PVID_MAX_P];
    model->jacobian(self->p, c);
    model->drifts(self->p, d);
    for (size_t one = 0; one < model->n_drifts; one++) {
        float direction[PVID_MAX_THETA] = {0.0f};
        for (size_t k = 0; k < model->n_c; k++) {
            direction[model->c_row[k]] += c[k] * d[(one * model->n_p) + model->c_column[k]];
        }
        forget_along(self, direction);
    }
}

#endif
