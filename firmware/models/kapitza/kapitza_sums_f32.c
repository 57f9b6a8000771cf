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

/* Adds x, x u, x u^2 .. to the n sums at `low`, the highest power first in memory. */
PVID_ALWAYS_INLINE void add_powers(float low[], size_t n, four x, four u)
{
    four power = x;
    PVID_UNROLL
    for (size_t i = n - 1u; i > 0u; i--) {
        low[i] = plus(low[i], power);
        power = times(power, u);
    }
    low[0] = plus(low[0], power);
}

#define OF_ROWS(field) {rows[0].field, rows[1].field, rows[2].field, rows[3].field}

void pvid_kapitza_add_rows_f32(const pvid_strong_row_f32 rows[restrict], float low[restrict])
{
    const four u = OF_ROWS(u);
    const four a = OF_ROWS(a);
    const four e = OF_ROWS(e);
    const four y = OF_ROWS(y);
    low[PVID_SUM_AA] = plus(low[PVID_SUM_AA], times(a, a));
    low[PVID_SUM_AE] = plus(low[PVID_SUM_AE], times(a, e));
    low[PVID_SUM_EE] = plus(low[PVID_SUM_EE], times(e, e));
    low[PVID_SUM_YA] = plus(low[PVID_SUM_YA], times(y, a));
    low[PVID_SUM_YE] = plus(low[PVID_SUM_YE], times(y, e));
    low[PVID_SUM_YY] = plus(low[PVID_SUM_YY], times(y, y));
    low[PVID_SUM_WEIGHT] += (float)PVID_STRONG_ROWS;
    const four f2 = OF_ROWS(f2);
    add_powers(&low[PVID_SUM_A2], 4, times(a, f2), u);
    add_powers(&low[PVID_SUM_E2], 4, times(e, f2), u);
    add_powers(&low[PVID_SUM_Y2], 4, times(y, f2), u);
    const four f0 = OF_ROWS(f0);
    add_powers(&low[PVID_SUM_A0], 5, times(a, f0), u);
    add_powers(&low[PVID_SUM_E0], 5, times(e, f0), u);
    add_powers(&low[PVID_SUM_Y0], 5, times(y, f0), u);
    add_powers(&low[PVID_SUM_K22], 7, times(f2, f2), u);
    add_powers(&low[PVID_SUM_K20], 8, times(f2, f0), u);
    add_powers(&low[PVID_SUM_K00], 9, times(f0, f0), u);
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
