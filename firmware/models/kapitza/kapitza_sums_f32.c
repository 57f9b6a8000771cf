#include "number/uncontracted.h"

/* The sums of the strong form (theory.md 2).
 *
 * Products repeat. With A = N_1, E = N_2, the other entries of N are -u^k phi'' and -u^k phi, so M and B hold only the
 * sums of products of A, E, Y, of A, E, Y times -u^k phi'' (k <= 3) and -u^k phi (k <= 4), and of phi''^2 u^k (k <= 6),
 * phi'' phi u^k (k <= 7), phi^2 u^k (k <= 8). A family of powers is one product and a multiplication by u for each next
 * power. A sum is loaded and stored once for a block of four rows.
 */
#include "kapitza_sums_f32.h"

#include "kapitza_project_f32.h"
#include "number/unroll.h"

/* A number of each row of a block. */
typedef struct {
    float r0;
    float r1;
    float r2;
    float r3;
} four;

static inline four times(four a, four b)
{
    const four product = {a.r0 * b.r0, a.r1 * b.r1, a.r2 * b.r2, a.r3 * b.r3};
    return product;
}

static inline float plus(float sum, four x)
{
    return (((sum + x.r0) + x.r1) + x.r2) + x.r3;
}

/* Adds x, x u, x u^2 .. to the n sums that end with *end, the highest power first in memory; n is least .. most. */
PVID_ALWAYS_INLINE void add_powers(float *end, size_t n, size_t least, size_t most, four x, four u)
{
    four power = x;
    *end = plus(*end, power);
    PVID_UNROLL
    for (size_t i = 1; i < most; i++) {
        if ((i >= least) && (i == n)) {
            break;
        }
        power = times(power, u);
        end--;
        *end = plus(*end, power);
    }
}

#define OF_ROWS(field) {block[0].field, block[1].field, block[2].field, last->field}

void pvid_kapitza_add_rows_f32(const pvid_strong_row_f32 block[restrict], const pvid_strong_row_f32 *restrict last,
                               float low[restrict])
{
    const four u = OF_ROWS(u);
    const four a = OF_ROWS(x[PVID_ROW_A]);
    const four e = OF_ROWS(x[PVID_ROW_E]);
    const four y = OF_ROWS(x[PVID_ROW_Y]);
    low[PVID_SUM_AA] = plus(low[PVID_SUM_AA], times(a, a));
    low[PVID_SUM_AE] = plus(low[PVID_SUM_AE], times(a, e));
    low[PVID_SUM_EE] = plus(low[PVID_SUM_EE], times(e, e));
    low[PVID_SUM_YA] = plus(low[PVID_SUM_YA], times(y, a));
    low[PVID_SUM_YE] = plus(low[PVID_SUM_YE], times(y, e));
    low[PVID_SUM_YY] = plus(low[PVID_SUM_YY], times(y, y));
    low[PVID_SUM_WEIGHT] += (float)PVID_STRONG_ROWS;
    const four f2 = OF_ROWS(f2);
    const four f0 = OF_ROWS(f0);
    PVID_NO_UNROLL
    for (size_t i = 0; i < 3u; i++) {
        const four x = OF_ROWS(x[i]);
        add_powers(&low[(PVID_SUM_A2 + 3u) + (4u * i)], 4, 4, 4, times(x, f2), u);
        add_powers(&low[(PVID_SUM_A0 + 4u) + (5u * i)], 5, 5, 5, times(x, f0), u);
    }
    four x = times(f2, f2);
    float *end = &low[PVID_SUM_K22 + 6u];
    PVID_NO_UNROLL
    for (size_t n = 7; n <= 9u; n++) {
        add_powers(end, n, 7, 9, x, u);
        x = (n == 7u) ? times(f2, f0) : times(f0, f0);
        end = (n == 7u) ? &low[PVID_SUM_K20 + 7u] : &low[PVID_SUM_K00 + 8u];
    }
}

/* Knuth's two-sum after forgetting: new high + new low = retention (high + low), but for the two products. */
void pvid_kapitza_fold_f32(pvid_strong_sums_f32 *self, size_t first, size_t end)
{
    const float retention = self->retention;
    for (size_t i = first; i < end; i++) {
        const float kept_high = self->high[i] * retention;
        const float kept_low = self->low[i] * retention;
        const float total = kept_high + kept_low;
        const float part = total - kept_high;
        self->high[i] = total;
        self->low[i] = (kept_high - (total - part)) + (kept_low - part);
    }
}

void pvid_kapitza_read_f32(const pvid_strong_sums_f32 *self, float sums[PVID_STRONG_SUMS])
{
    for (size_t i = 0; i < PVID_STRONG_SUMS; i++) {
        sums[i] = pvid_kapitza_sum_f32(self, i);
    }
}
