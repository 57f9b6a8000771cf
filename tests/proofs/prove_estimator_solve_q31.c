/* A solve from any state, with a fallback or without: every stage, nothing of `solve` there before. Leaves a state as
 * it was: p within its bounds, the sums within theirs. */
#include "any_estimator_q31.h"

#include "contracts.h"

static void any_solve(const pvid_model_q31 *model, bool ends_group, bool has_fallback)
{
    pvid_estimator_q31 estimator;
    pvid_estimator_solve_q31 solve;
    any_state(model, &estimator);
    pvid_estimator_begin_q31(&estimator, &solve, ends_group);
    solve.has_fallback = has_fallback;
    if (has_fallback) {
        for (size_t a = 0; a < model->n_p; a++) {
            solve.fallback[a] = any_i32((((model->positive >> a) & 1u) != 0u) ? 1 : -INT32_MAX, INT32_MAX);
        }
    }
    while (!pvid_estimator_advance_q31(&estimator, &solve)) {
    }
    /*@ assert \initialized(&solve.reason) && \initialized(&solve.size) && \initialized(&solve.above_noise); */
    for (size_t a = 0; a < model->n_p; a++) {
        /*@ assert -0x7FFFFFFF <= estimator.p[a] <= 0x7FFFFFFF; */
        if (((model->positive >> a) & 1u) != 0u) {
            /*@ assert 1 <= estimator.p[a]; */
        }
    }
    for (size_t i = 0; i < model->n_theta; i++) {
        /*@ assert -0x1000000000000000 <= estimator.theta[i] <= 0x1000000000000000; */
        /*@ assert -0x40000000 <= estimator.mantissa[i] <= 0x40000000; */
        /*@ assert -2000 <= estimator.shift[i] <= 2000; */
    }
    for (size_t i = 0; i < model->n_theta; i++) {
        /*@ assert -0x3000000000000000 <= estimator.fresh[i] <= 0x3000000000000000; */
    }
    for (size_t i = 0; i < estimator.information.n_sums; i++) {
        /*@ assert -0x4000000000000000 <= estimator.information.sums[i] <= 0x4000000000000000; */
    }
    /*@ assert 0 <= estimator.information.sums[estimator.information.n_sums - 2]; */
}

void main(void)
{
    const pvid_model_q31 *const models[3] = {&dense, &blocks, &numbers};
    for (size_t i = 0; i < 3u; i++) {
        any_solve(models[i], true, false);
        any_solve(models[i], false, true);
    }
}
