#include "information_q31.h"

#include <stddef.h>
#include <string.h>

#include "integer_q31.h"

#define BLOCK_MAX 64u
#define SUM_LOW ((int64_t)1 << 54)
#define KEEP INT32_MAX

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

void pvid_information_init_q31(pvid_information_q31 *self, uint8_t n_theta, uint32_t forgetting_groups,
                               uint32_t row_weight)
{
    memset(self, 0, sizeof *self);
    self->n_theta = n_theta;
    self->n_sums = (uint16_t)(((n_theta * (n_theta + 1u)) / 2u) + n_theta + 2u);
    self->block = BLOCK_MAX;
    self->retention = KEEP;
    self->row_weight = row_weight;
    if (forgetting_groups > 0u) {
        if (forgetting_groups < (16u * BLOCK_MAX)) {
            self->block = (uint16_t)((forgetting_groups < 32u) ? 1u : (forgetting_groups / 16u));
        }
        self->retention = decay(self->block, forgetting_groups);
    }
}

void pvid_information_add_q31(pvid_information_q31 *self, const int32_t n[], int32_t e, int64_t fresh[])
{
    const size_t n_theta = self->n_theta;
    int32_t row[PVID_MAX_THETA_Q31];
    for (size_t i = 0; i < n_theta; i++) {
        row[i] = (int32_t)pvid_round_shift_q31(n[i], self->exponent);
    }
    const int32_t error = (int32_t)pvid_round_shift_q31(e, self->exponent);
    int64_t *sum = self->sums;
    for (size_t i = 0; i < n_theta; i++) {
        for (size_t j = i; j < n_theta; j++) {
            *sum += (int64_t)row[i] * row[j];
            sum++;
        }
    }
    for (size_t i = 0; i < n_theta; i++) {
        const int64_t product = (int64_t)row[i] * error;
        sum[i] += product;
        if (fresh != NULL) {
            fresh[i] += product;
        }
    }
    sum[n_theta] += (int64_t)error * error;
    sum[n_theta + 1u] += self->row_weight;
}

/* The largest sum of squares: the others cannot be larger. */
static int64_t largest_of(const pvid_information_q31 *self)
{
    int64_t largest = self->sums[self->n_sums - 2u];
    for (uint32_t i = 0; i < self->n_theta; i++) {
        const int64_t own = self->sums[pvid_moment_q31(self->n_theta, i, i)];
        largest = (own > largest) ? own : largest;
    }
    return largest;
}

void pvid_information_end_group_q31(pvid_information_q31 *self, int64_t fresh[])
{
    self->age++;
    if (self->age >= self->block) {
        self->age = 0;
        if (self->retention < KEEP) {
            for (size_t i = 0; i < self->n_sums; i++) {
                self->sums[i] = pvid_times_q31(self->sums[i], self->retention);
            }
        }
    }
    const int64_t largest = largest_of(self);
    int32_t change = 0;
    if (largest > PVID_SUM_LIMIT) {
        change = 1;
    } else if ((largest < SUM_LOW) && (self->exponent > 0u)) {
        change = -1;
    } else {
        return;
    }
    for (size_t i = 0; i < (self->n_sums - 1u); i++) {
        self->sums[i] = pvid_scale_q31(self->sums[i], 2 * change);
    }
    for (size_t i = 0; i < self->n_theta; i++) {
        fresh[i] = pvid_scale_q31(fresh[i], 2 * change);
    }
    self->exponent = (uint8_t)((int32_t)self->exponent + change);
}
