/* Accuracy of the strong form's estimate in integers. */
#include <string.h>

#include "kapitza_integer_q31.h"
#include "kapitza_sums_q31.h"
#include "solve/assess_q31.h"

#define FINER_BITS 24 /* of S, so that it has room for the information of the start alone */

/* S in the units of the integers p and of the divided sums. */
static void begin_system(const pvid_kapitza_estimator_q31 *self, pvid_system_q31 *system)
{
    static const uint8_t place[PVID_KAPITZA_P][PVID_KAPITZA_P] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    pvid_kapitza_system_q31 own;
    int32_t of[PVID_KAPITZA_P];
    pvid_kapitza_project_q31(self, &own);
    pvid_kapitza_exponents_q31(self, &own, of);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        system->f[a] = (int16_t)(of[a] - ((PVID_S_BITS + FINER_BITS) / 2));
        for (size_t b = 0; b < PVID_KAPITZA_P; b++) {
            system->s[a][b] = own.s[place[a][b]] * ((int64_t)1 << FINER_BITS);
        }
    }
}

static void factor(pvid_system_q31 *system)
{
    pvid_system_begin_factor_q31(system, PVID_KAPITZA_P, (const int64_t (*)[PVID_MAX_P])system->s);
    for (size_t part = 0; (part * PVID_PIVOTS_PER_PART) < PVID_KAPITZA_P; part++) {
        pvid_system_eliminate_q31(system, PVID_KAPITZA_P, part);
    }
}

void pvid_kapitza_estimator_assess_q31(const pvid_kapitza_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    if (estimate == NULL) {
        return;
    }
    memset(estimate, 0, sizeof *estimate);
    const bool ready = (self != NULL) && self->ready;
    PVID_ASSERT(ready);
    if (!ready) {
        return;
    }
    const pvid_scaled_q31 unknown = {0, 0};
    const pvid_residual_q31 residual = {pvid_kapitza_residual_q31(self), self->sums[PVID_SUM_WEIGHT], self->exponent};
    pvid_scaled_q31 variance;
    pvid_system_q31 system;
    pvid_inverse_q31 inverse;
    memcpy(estimate->p, self->p, sizeof self->p);
    pvid_assess_residual_q31(&residual, &self->settings, unknown, &variance, &inverse.wide, estimate);
    begin_system(self, &system);
    factor(&system);
    if (system.factor.positive) {
        estimate->kappa = system.factor.first_pivot;
        estimate->least_pivot = pvid_cholesky_least_pivot_q31(&system.factor, (const int32_t (*)[PVID_MAX_P])system.q);
    }
    pvid_assess_widen_q31(&system, &self->settings, inverse.wide);
    factor(&system);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        pvid_assess_invert_q31(&system.factor, a, &inverse);
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        pvid_assess_errors_q31(&system, &self->settings, &inverse, a, estimate);
    }
}
