/* An assessment of the strong form: any normal equations and residual that its other files make, any settings. */
#include "prove.h"

#include "contracts.h"
#include "kapitza_contracts.h"
#include "kapitza_places.h"

static pvid_kapitza_estimator_q31 estimator;

void main(void)
{
    pvid_estimate_q31 estimate;
    estimator.sums[PVID_SUM_WEIGHT] = any_i64(0, (int64_t)1 << 61);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator.p[a] = any_i32(1, INT32_MAX);
        estimator.settings.start_sd[a] = any_i32(1, INT32_MAX);
    }
    estimator.settings.n_p = PVID_KAPITZA_P;
    estimator.settings.positive = 7;
    estimator.settings.row_sd = any_i32(1, INT32_MAX);
    estimator.settings.correlation = any_u32((uint32_t)1 << 16, (uint32_t)1 << 31);
    estimator.exponent = (uint8_t)any_u32(0, 30);
    estimator.ready = true;
    pvid_kapitza_estimator_assess_q31(&estimator, &estimate);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        /*@ assert 0 <= estimate.se[a]; */
    }
    /*@ assert 0 <= estimate.kappa <= 0x40000000; */
    /*@ assert 0 <= estimate.least_pivot <= 0x40000000; */
    /*@ assert 0 <= estimate.residual_sd; */
}
