#include "number/uncontracted.h"

#include "solve/information_f32.h"

#include <stddef.h>

#include "number/unroll.h"
#include "solve/settings_f32.h"

/* Most groups of rows between folds. Long enough to be cheap; short enough that `low` keeps 17 bits of a group's
 * terms and that forgetting is smooth (a sixteenth of its time constant). */
#define BLOCK_MAX 64u

PVID_COLD void pvid_information_init_f32(pvid_information_f32 *self, const pvid_model_f32 *model,
                                         float forgetting_groups)
{
    self->n_moments = model->n_moments;
    self->n_theta = model->n_theta;
    self->block = BLOCK_MAX;
    self->age = 0;
    self->retention = 1.0f;
    self->row_weight = 1.0f;
    self->rounding = 0.0f;
    if (forgetting_groups > 0.0f) {
        if (forgetting_groups < 16.0f * (float)BLOCK_MAX) {
            self->block = (uint16_t)((forgetting_groups < 32.0f) ? 1.0f : (forgetting_groups / 16.0f));
        }
        self->retention = pvid_settings_decay_f32((float)self->block / forgetting_groups);
    }
    for (size_t i = 0; i < PVID_MAX_SUMS; i++) {
        self->high[i] = 0.0f;
        self->low[i] = 0.0f;
    }
}

static size_t number_of_sums(const pvid_information_f32 *self)
{
    return (size_t)self->n_moments + self->n_theta + 2u;
}

/* All products of a row of a kind: the packed upper triangle by rows, then N y, y^2 and the weight. */
static inline void accumulate_block(const pvid_model_f32 *model, const pvid_block *block, const float *restrict n,
                                    float y, float row_weight, float *restrict sums)
{
    const size_t n_own = block->n;
    float *restrict low = &sums[block->moment];
    for (size_t i = 0; i < n_own; i++) {
        for (size_t j = i; j < n_own; j++) {
            *low += n[i] * n[j];
            low++;
        }
    }
    low = &sums[model->n_moments + block->first];
    for (size_t i = 0; i < n_own; i++) {
        low[i] += y * n[i];
    }
    low = &sums[model->n_moments + model->n_theta];
    low[0] += y * y;
    low[1] += row_weight;
}

void pvid_information_add_block_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const pvid_block *block,
                                    const float n[], float y)
{
    accumulate_block(model, block, n, y, self->row_weight, self->low);
}

void pvid_information_add_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const float n[], float y,
                              float sums[PVID_MAX_SUMS])
{
    pvid_block block;
    pvid_information_block_f32(model, 0, &block);
    pvid_information_add_block_f32(self, model, &block, n, y);
    if (sums != NULL) {
        pvid_information_read_f32(self, sums);
    }
}

/* Knuth's two-sum after forgetting: new high + new low = retention (high + low), but for the two products. */
static inline void fold(float *restrict high, float *restrict low, float retention)
{
    const float kept_high = *high * retention;
    const float kept_low = *low * retention;
    const float total = kept_high + kept_low;
    const float part = total - kept_high;
    *high = total;
    *low = (kept_high - (total - part)) + (kept_low - part);
}

void pvid_information_end_group_f32(pvid_information_f32 *self)
{
    self->age++;
    if (self->age < self->block) {
        return;
    }
    self->age = 0;
    const size_t sums = number_of_sums(self);
    const float retention = self->retention;
    for (size_t i = 0; i < sums; i++) {
        fold(&self->high[i], &self->low[i], retention);
    }
    self->rounding *= retention;
}

void pvid_information_fade_f32(pvid_information_f32 *self, float factor)
{
    const size_t sums = number_of_sums(self);
    for (size_t i = 0; i < sums; i++) {
        self->high[i] *= factor;
        self->low[i] *= factor;
    }
    self->rounding *= factor;
}

void pvid_information_read_f32(const pvid_information_f32 *self, float sums[PVID_MAX_SUMS])
{
    const size_t n = number_of_sums(self);
    for (size_t i = 0; i < n; i++) {
        sums[i] = self->high[i] + self->low[i];
    }
}

void pvid_information_tail_f32(const pvid_information_f32 *self, float tail[2])
{
    const size_t yy = (size_t)self->n_moments + self->n_theta;
    tail[0] = self->high[yy] + self->low[yy];
    tail[1] = self->high[yy + 1u] + self->low[yy + 1u];
}
