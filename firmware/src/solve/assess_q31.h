/* Accuracy of p from the normal equations, in integers: residual variance, standard errors. Pure: the results depend on
 * the arguments alone. Private to the core. */
#ifndef PVID_SOLVE_ASSESS_Q31_H
#define PVID_SOLVE_ASSESS_Q31_H

#include <stddef.h>
#include <stdint.h>

#include "number/scaled_q31.h"
#include "solve/cholesky_q31.h"
#include "solve/system_q31.h"

/* Bits of the 1 whose column of U^-1 is computed. */
static inline int32_t pvid_unit_bits_q31(uint32_t n)
{
    return pvid_rhs_bits_q31(n) - 1;
}

/* What the rows in the sums leave: sum of squares of the residuals, divided by 4^exponent, and the rows' weight, Q16.
 */
typedef struct {
    int64_t residual;
    int64_t weight;
    uint8_t exponent;
} pvid_residual_q31;

static inline pvid_residual_q31 pvid_residual_of_q31(const pvid_information_q31 *sums)
{
    const pvid_residual_q31 residual = {sums->sums[sums->n_sums - 2u], sums->sums[sums->n_sums - 1u], sums->exponent};
    return residual;
}

/* row_sd^2, divided by 4^exponent as the sums are. */
pvid_scaled_q31 pvid_assess_row_variance_q31(const pvid_solve_settings_q31 *settings, int32_t exponent);

/* s^2 of a row: residual sum of squares over degrees of freedom, at least `expected`; row_sd^2 if there is none.
 * Divided by 4^exponent as the sums are. expected: variance of a row by the sensors' noise [units of Y's integer
 * squared]; 0: unknown. Cost: a division of 64 bits. */
pvid_scaled_q31 pvid_assess_variance_q31(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                                         pvid_scaled_q31 expected);

/* Writes weight, misfit and residual_sd of the estimate, *variance = s^2, and *wide = root of correlation s^2. Cost:
 * two square roots, two divisions of 64 bits. */
void pvid_assess_residual_q31(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                              pvid_scaled_q31 expected, pvid_scaled_q31 *variance, pvid_root_q31 *wide,
                              pvid_estimate_q31 *estimate);

/* S += wide^2 / start_sd^2. Cost: n_p divisions. */
void pvid_assess_widen_q31(pvid_system_q31 *system, const pvid_solve_settings_q31 *settings, pvid_root_q31 wide);

/* Column a of U^-1 and its length. Does nothing iff the matrix could not be factored. Cost: half a solve, a root. */
void pvid_assess_invert_q31(const pvid_cholesky_q31 *factor, size_t a, pvid_inverse_q31 *inverse);

/* Standard error of p[a], within INT32_MAX: wide times the root of the diagonal entry of (S + H)^-1, which is
 * 2^-(31 + pvid_unit_bits_q31(n) + f_a + g_a) times own, the length of column a of U^-1. */
int32_t pvid_assess_error_q31(const pvid_system_q31 *system, pvid_root_q31 own, size_t a, pvid_root_q31 wide);

/* Standard error of p[a] and its correlation with those before it, from wide^2 (S + H)^-1; start_sd and 0 iff the
 * matrix could not be factored. Cost: 2 a divisions. Source: theory.md 4, equation (7). */
void pvid_assess_errors_q31(const pvid_system_q31 *system, const pvid_solve_settings_q31 *settings,
                            const pvid_inverse_q31 *inverse, size_t a, pvid_estimate_q31 *estimate);

#endif
