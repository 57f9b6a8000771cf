/* An assessment from any state: every stage, nothing of `solve` there before. Gives an estimate as the verdict and the
 * physical parameters take it. */
#include "any_estimator_q31.h"

#include "contracts.h"

static void any_assessment(const pvid_model_q31 *model)
{
    pvid_estimator_q31 estimator;
    pvid_estimator_solve_q31 solve;
    pvid_estimate_q31 estimate;
    any_state(model, &estimator);
    pvid_estimator_begin_assessment_q31(&estimator, &solve);
    while (!pvid_estimator_assess_advance_q31(&estimator, &solve, &estimate)) {
    }
    for (size_t a = 0; a < model->n_p; a++) {
        /*@ assert 0 <= estimate.se[a]; */
        for (size_t b = 0; b < model->n_p; b++) {
            /*@ assert -0x40000000 <= estimate.correlation[a][b] <= 0x40000000; */
        }
    }
    /*@ assert 0 <= estimate.kappa <= 0x40000000; */
    /*@ assert 0 <= estimate.least_pivot <= 0x40000000; */
    /*@ assert 0 <= estimate.residual_sd; */
    /*@ assert 0 <= estimate.misfit; */
    (void)pvid_estimator_assessment_stages_q31(&estimator);
    (void)pvid_estimator_stages_q31(&estimator, true);
}

/* What the sensors explain of a group of rows. */
static void any_group(const pvid_model_q31 *model)
{
    pvid_estimator_q31 estimator;
    const pvid_scaled_q31 variance = {any_i32(0, PVID_ONE_Q30), any_i32(-2000, 2000)};
    any_state(model, &estimator);
    pvid_estimator_set_expected_q31(&estimator, variance);
}

void main(void)
{
    any_group(&dense);
    any_assessment(&dense);
    any_assessment(&blocks);
    any_assessment(&numbers);
}
