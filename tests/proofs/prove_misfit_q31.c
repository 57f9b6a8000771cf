/* misfit_q31: any configuration; any row, and any verdict, on top of any sums that rows leave. */
#include "prove.h"

#include "contracts.h"
#include "judge/misfit_q31.h"

/* Exponents: 65 535 squares below 2^62 add up to less than 2^78, and an estimate of any size is told within 2^31. */
#define LOWEST (-1000)
#define HIGHEST 1000

#define SQUARE_MAX 0x100000000000000 /* of a residual, and of what is told of a row: 2^56 */

static pvid_scaled_q31 any_sum(void)
{
    const pvid_scaled_q31 x = {any_i32(0, PVID_ONE_Q30), any_i32(LOWEST, HIGHEST)};
    return x;
}

/* Any state with so many rows left until it is judged. */
static void any_row(uint16_t left)
{
    pvid_misfit_q31 misfit;
    pvid_misfit_init_q31(&misfit, any_u32(1, 0x40000000), any_u32(0, UINT32_MAX));
    /*@ assert 1 <= misfit.block && 1 <= misfit.left; */
    /*@ assert 0 <= misfit.growth.m <= 0x40000000; */
    const int64_t rows = (int64_t)PVID_MISFIT_FEW - 1 - (left - 1u) % PVID_MISFIT_FEW; /* not yet added up */
    misfit.few_rss = any_i64(0, rows * SQUARE_MAX);
    misfit.few_signal = any_i64(0, rows * SQUARE_MAX);
    misfit.rss = any_sum();
    misfit.signal = any_sum();
    misfit.least_rss = any_sum();
    misfit.least_part = any_sum();
    misfit.left = left;
    const int64_t signal = pvid_misfit_signal_q31(any_i64(-INT64_MAX, INT64_MAX - 1));
    /*@ assert 0 <= signal <= SQUARE_MAX; */
    if (pvid_misfit_add_q31(&misfit, any_i64(0, 8 * SQUARE_MAX), any_i64(0, 8 * SQUARE_MAX))) {
        misfit.rss = any_sum();
        misfit.signal = any_sum();
        (void)pvid_misfit_judge_q31(&misfit);
        /*@ assert misfit.few_rss == 0 && misfit.few_signal == 0; */
    } else {
        /*@ assert 0 <= misfit.few_rss <= (rows + 1) * SQUARE_MAX; */
        /*@ assert 0 <= misfit.few_signal <= (rows + 1) * SQUARE_MAX; */
    }
    /*@ assert 1 <= misfit.left; */
}

void main(void)
{
    for (uint32_t left = 1; left <= PVID_MISFIT_FEW; left++) { /* alike in every further PVID_MISFIT_FEW rows */
        any_row((uint16_t)left);
        any_row((uint16_t)(left + PVID_MISFIT_FEW));
    }
}
