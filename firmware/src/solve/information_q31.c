#include "solve/information_q31.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/integer_q31.h"
#include "number/unroll.h"

#define BLOCK_MAX 64u
#define SUM_LOW ((int64_t)1 << 54)
#define KEEP INT32_MAX
#define RESIDUAL_MAX                                                                                                   \
    (3 * PVID_SUM_LIMIT) /* of rr, which the rows of all kinds add to: 16 rows of one stay below it                    \
                          */

/* exp(-block / groups) in Q31 for block <= groups / 4, by the series of exp. */
static int32_t decay(uint32_t block, uint32_t groups)
{
    const int64_t one = (int64_t)1 << 31;
    const int64_t x = ((int64_t)block << 31) / groups;
    int64_t sum = one;
    for (int64_t k = 12; k > 0; k--) {
        sum = one - (pvid_floor_shift_q31(x * sum, 31) / k);
    }
    return (int32_t)((sum > KEEP) ? KEEP : sum);
}

PVID_COLD int32_t pvid_information_retention_q31(uint32_t forgetting_groups, uint16_t *block)
{
    *block = BLOCK_MAX;
    if (forgetting_groups == 0u) {
        return KEEP;
    }
    if (forgetting_groups < (16u * BLOCK_MAX)) {
        *block = (uint16_t)((forgetting_groups < 32u) ? 1u : (forgetting_groups / 16u));
    }
    return decay(*block, forgetting_groups);
}

void pvid_information_block_q31(const pvid_model_q31 *model, size_t i, pvid_block *block)
{
    block->first = 0;
    block->n = model->n_theta;
    block->moment = 0;
    if (model->n_kinds > 1u) {
        pvid_block_among_kinds(model->n_kinds, model->kind_end, i, block);
    }
}

void pvid_information_init_q31(pvid_information_q31 *self, const pvid_model_q31 *model, uint32_t forgetting_groups,
                               uint32_t row_weight)
{
    memset(self, 0, sizeof *self);
    self->n_theta = model->n_theta;
    self->n_sums =
        (uint16_t)(pvid_kinds_moments(model->n_theta, model->n_kinds, model->kind_end) + model->n_theta + 2u);
    self->retention = pvid_information_retention_q31(forgetting_groups, &self->block);
    self->row_weight = row_weight;
}

void pvid_information_add_q31(pvid_information_q31 *self, const pvid_block *block, const int32_t n[], int32_t e,
                              int64_t fresh[])
{
    const size_t n_own = block->n;
    int32_t row[PVID_MAX_THETA_Q31];
    for (size_t i = 0; i < n_own; i++) {
        row[i] = (int32_t)pvid_round_shift_q31(n[i], self->exponent);
    }
    const int32_t error = (int32_t)pvid_round_shift_q31(e, self->exponent);
    int64_t *sum = &self->sums[block->moment];
    for (size_t i = 0; i < n_own; i++) {
        for (size_t j = i; j < n_own; j++) {
            *sum += pvid_short_product_q31(row[i], row[j]);
            sum++;
        }
    }
    int64_t *tail = &self->sums[self->n_sums - 2u]; /* rr, weight */
    sum = &tail[(ptrdiff_t)block->first - (ptrdiff_t)self->n_theta];
    for (size_t i = 0; i < n_own; i++) {
        const int64_t product = pvid_short_product_q31(row[i], error);
        sum[i] += product;
        fresh[block->first + i] += product;
    }
    tail[0] = pvid_clamp_q31(tail[0] + pvid_short_square_q31(error), RESIDUAL_MAX);
    tail[1] += (int64_t)self->row_weight;
}

/* The largest sum of squares: the others cannot be larger. */
static int64_t largest_of(const pvid_information_q31 *self, const pvid_model_q31 *model)
{
    int64_t largest = self->sums[self->n_sums - 2u];
    const int64_t *diagonal = self->sums;
    size_t kind = 0;
    size_t end = pvid_information_end_of_q31(model, 0);
    for (size_t i = 0; i < model->n_theta; i++) {
        if (i == end) {
            kind++;
            end = pvid_information_end_of_q31(model, kind);
        }
        largest = (*diagonal > largest) ? *diagonal : largest;
        diagonal += end - i; /* entries of row i of its block */
    }
    return largest;
}

/* Multiplies the sums first..last-1 by the retention if a block is complete. */
static void forget(pvid_information_q31 *self, size_t first, size_t last)
{
    if ((self->age < self->block) || (self->retention == KEEP)) {
        return;
    }
    for (size_t i = first; i < last; i++) {
        self->sums[i] = pvid_times_q31(self->sums[i], self->retention);
    }
}

static int64_t quarter(int64_t x)
{
    return pvid_round_shift_q31(x, 2);
}

static int64_t four_times(int64_t x)
{
    return 4 * pvid_clamp_q31(x, PVID_WIDE / 4);
}

static void rescale(pvid_information_q31 *self, const pvid_model_q31 *model, int64_t fresh[])
{
    const int64_t largest = largest_of(self, model);
    const bool less = largest > PVID_SUM_LIMIT;
    if (!less && ((largest >= SUM_LOW) || (self->exponent == 0u))) {
        return;
    }
    for (size_t i = 0; i < (self->n_sums - 1u); i++) {
        self->sums[i] = less ? quarter(self->sums[i]) : four_times(self->sums[i]);
    }
    for (size_t i = 0; i < self->n_theta; i++) {
        fresh[i] = less ? quarter(fresh[i]) : four_times(fresh[i]);
    }
    self->exponent = (uint8_t)(less ? (self->exponent + 1u) : (self->exponent - 1u));
}

void pvid_information_end_group_q31(pvid_information_q31 *self, const pvid_model_q31 *model, size_t part,
                                    int64_t fresh[])
{
    const size_t half = self->n_sums / 2u;
    if (part == 0u) {
        self->age++;
        forget(self, 0, half);
        return;
    }
    forget(self, half, self->n_sums);
    self->age = (uint16_t)((self->age < self->block) ? self->age : 0u);
    rescale(self, model, fresh);
    for (size_t i = 0; i < self->n_theta; i++) { /* of more groups than the sums may remember */
        fresh[i] = pvid_clamp_q31(fresh[i], 2 * PVID_SUM_LIMIT);
    }
}

void pvid_information_fade_q31(pvid_information_q31 *self, size_t part, int32_t factor)
{
    const size_t half = self->n_sums / 2u;
    const size_t last = (part == 0u) ? half : self->n_sums;
    for (size_t i = (part == 0u) ? 0u : half; i < last; i++) {
        self->sums[i] = pvid_times_q31(self->sums[i], factor);
    }
}
