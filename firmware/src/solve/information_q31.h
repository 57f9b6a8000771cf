/* The sums of the fixed-point estimator: exact, and never near the end of an int64. Private to the core. */
#ifndef PVID_INFORMATION_Q31_H
#define PVID_INFORMATION_Q31_H

#include <stddef.h>

#include "pvid/estimator_q31.h"
#include "solve/kinds.h"

/* If a sum of squares exceeds this, all sums of squares are divided by 4. */
#define PVID_SUM_LIMIT ((int64_t)1 << 60)

/* The block of M that contains entry i of theta. */
void pvid_information_block_q31(const pvid_model_q31 *model, size_t i, pvid_block *block);

/* One past the last entry of theta of a kind. */
static inline size_t pvid_information_end_of_q31(const pvid_model_q31 *model, size_t kind)
{
    return (model->n_kinds > 1u) ? model->kind_end[kind] : model->n_theta;
}

/* The factor on the past, Q31, after every *block groups of rows: a time constant of forgetting_groups, 0: 2^31 - 1,
 * everything is kept. */
int32_t pvid_information_retention_q31(uint32_t forgetting_groups, uint16_t *block);

/* Empty sums; forgetting_groups as in pvid_estimator_config_q31. */
void pvid_information_init_q31(pvid_information_q31 *self, const pvid_model_q31 *model, uint32_t forgetting_groups,
                               uint32_t row_weight);

/* Adds a row (N, e) of the kind with this block, within PVID_ROW_LIMIT_Q31; fresh[n_theta] += N e too. */
void pvid_information_add_q31(pvid_information_q31 *self, const pvid_block *block, const int32_t n[], int32_t e,
                              int64_t fresh[]);

/* Ends a group of rows: forgets when it is time to, and keeps the sums of squares below PVID_SUM_LIMIT and, as far as
 * they were divided before, above 2^54. fresh[n_theta] follows, within twice that. Call it for part = 0, 1.. of the
 * work. */
#define PVID_INFORMATION_END_PARTS 2u
void pvid_information_end_group_q31(pvid_information_q31 *self, const pvid_model_q31 *model, size_t part,
                                    int64_t fresh[]);

/* Multiplies all sums by factor, Q31, with rounding; for part = 0, 1 of the work. */
void pvid_information_fade_q31(pvid_information_q31 *self, size_t part, int32_t factor);

/* Place of M_ij, i <= j, in a packed block of order n. */
static inline size_t pvid_moment_q31(size_t n, size_t i, size_t j)
{
    return ((i * ((2u * n) - i - 1u)) / 2u) + j;
}

#endif
