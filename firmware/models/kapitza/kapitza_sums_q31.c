/* The repeated moments of the strong form's rows in integers. */
#include "kapitza_sums_q31.h"

#include "kapitza_integer_q31.h"
#include "number/unroll.h"
#include "solve/information_q31.h"

#define SUM_LOW ((int64_t)1 << 54)
#define KEEP INT32_MAX

/* sums[i] += a x[i]. */
PVID_ALWAYS_INLINE void add_products(int32_t a, const int32_t x[], size_t count, int64_t sums[])
{
    PVID_UNROLL
    for (size_t i = 0; i < count; i++) {
        sums[i] += pvid_short_product_q31(a, x[i]);
    }
}

void pvid_kapitza_add_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31])
{
    int32_t n[PVID_KAPITZA_ROW_Q31 - 1];
    for (size_t i = 0; i < (PVID_KAPITZA_ROW_Q31 - 1u); i++) {
        const int32_t half = (int32_t)(((uint32_t)1 << self->exponent) >> 1u);
        n[i] = pvid_floor_shift_32_q31(row[i] + half, self->exponent);
    }
    const int32_t a = n[PVID_ROW_A];
    const int32_t e = n[PVID_ROW_E];
    const int32_t y = n[PVID_ROW_Y];
    const int32_t *x = &n[PVID_ROW_X];
    const int32_t *z = &n[PVID_ROW_Z];
    int64_t *sums = self->sums;
    add_products(a, n, 2, &sums[PVID_SUM_AA]);
    add_products(e, &n[PVID_ROW_E], 1, &sums[PVID_SUM_EE]);
    add_products(y, n, 2, &sums[PVID_SUM_YA]);
    add_products(y, &n[PVID_ROW_Y], 1, &sums[PVID_SUM_YY]);
    add_products(a, x, 4, &sums[PVID_SUM_A2]);
    add_products(e, x, 4, &sums[PVID_SUM_E2]);
    add_products(y, x, 4, &sums[PVID_SUM_Y2]);
    add_products(a, z, 5, &sums[PVID_SUM_A0]);
    add_products(e, z, 5, &sums[PVID_SUM_E0]);
    add_products(y, z, 5, &sums[PVID_SUM_Y0]);
    add_products(x[0], x, 4, &sums[PVID_SUM_K22]); /* G^6 .. G^3, then G^2 .. 1 */
    add_products(x[3], &x[1], 3, &sums[PVID_SUM_K22 + 4]);
    add_products(z[0], x, 4, &sums[PVID_SUM_K20]); /* G^7 .. G^4, then G^3 .. 1 */
    add_products(x[3], &z[1], 4, &sums[PVID_SUM_K20 + 4]);
    add_products(z[0], z, 5, &sums[PVID_SUM_K00]); /* G^8 .. G^4, then G^3 .. 1 */
    add_products(z[4], &z[1], 4, &sums[PVID_SUM_K00 + 5]);
    sums[PVID_SUM_WEIGHT] += (int64_t)1 << 16;
}

/* The largest of the sums of squares, all >= 0: no other sum exceeds twice it. */
static int64_t largest_of(const int64_t sums[])
{
    static const uint8_t squares[] = {PVID_SUM_AA,      PVID_SUM_EE,  PVID_SUM_YY,     PVID_SUM_K22,
                                      PVID_SUM_K22 + 6, PVID_SUM_K00, PVID_SUM_K00 + 8};
    int64_t largest = 0;
    for (size_t i = 0; i < (sizeof squares / sizeof squares[0]); i++) {
        const int64_t own = sums[squares[i]];
        largest = (own > largest) ? own : largest;
    }
    return largest;
}

static void rescale(pvid_kapitza_estimator_q31 *self)
{
    const int64_t largest = largest_of(self->sums);
    const bool less = largest > PVID_SUM_LIMIT;
    if (!less && ((largest >= SUM_LOW) || (self->exponent == 0u))) {
        return;
    }
    for (size_t i = 0; i < PVID_SUM_WEIGHT; i++) {
        const int64_t sum = self->sums[i];
        self->sums[i] = less ? pvid_nearest_q31(sum, 2) : (4 * pvid_clamp_q31(sum, PVID_WIDE / 4));
    }
    self->exponent = (uint8_t)(less ? (self->exponent + 1u) : (self->exponent - 1u));
}

/* Eight rows add 2^59 to a sum at most. */
void pvid_kapitza_end_row_q31(pvid_kapitza_estimator_q31 *self)
{
    self->age++;
    const bool ends_block = self->age >= self->block;
    if (ends_block || ((self->age % 8u) == 0u)) {
        rescale(self);
    }
    if (!ends_block) {
        return;
    }
    self->age = 0;
    if (self->retention != KEEP) {
        for (size_t i = 0; i < PVID_KAPITZA_SUMS_Q31; i++) {
            self->sums[i] = pvid_times_q31(self->sums[i], self->retention);
        }
    }
}
