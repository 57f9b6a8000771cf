/* Start and rows of an estimator: any configuration, which leaves a state of any_estimator_q31.h; any row on top of any
 * of them (how far its sums grow with it is what prove_information_q31.c is about). */
#include "any_estimator_q31.h"

#include "contracts.h"

static void any_configuration(const pvid_model_q31 *model, uint8_t placed)
{
    pvid_estimator_q31 estimator;
    pvid_estimator_config_q31 config;
    Frama_C_make_unknown((char *)&config, sizeof config);
    config.model = model;
    if (pvid_estimator_init_q31(&estimator, &config) != PVID_OK) {
        return;
    }
    pvid_estimator_place_q31(&estimator, placed, any_i64(-INT64_MAX, INT64_MAX));
    for (size_t a = 0; a < model->n_p; a++) {
        /*@ assert -0x7FFFFFFF <= estimator.p[a]; */
        if (((model->positive >> a) & 1u) != 0u) {
            /*@ assert 1 <= estimator.settings.lower[a] && 1 <= estimator.p[a]; */
        }
        /*@ assert 1 <= estimator.settings.start_sd[a]; */
        /*@ assert 0 <= estimator.settings.prior[a]; */
        /*@ assert -200 <= estimator.settings.prior_exponent[a] <= 200; */
    }
    for (size_t i = 0; i < model->n_theta; i++) {
        /*@ assert -EXPONENT_BOUND <= estimator.theta_bits[i] <= EXPONENT_BOUND; */
        /*@ assert -EXPONENT_BOUND <= estimator.align[i] <= EXPONENT_BOUND; */
        /*@ assert -2 * EXPONENT_BOUND <= estimator.shift[i] <= 2 * EXPONENT_BOUND; */
        /*@ assert -0x40000000 <= estimator.mantissa[i] <= 0x40000000; */
        /*@ assert -0x1000000000000000 <= estimator.theta[i] <= 0x1000000000000000; */
    }
    for (size_t k = 0; k < model->n_c; k++) {
        /*@ assert -EXPONENT_BOUND <= estimator.c_exponent[k] <= EXPONENT_BOUND; */
    }
    /*@ assert 1 <= estimator.settings.row_sd; */
    /*@ assert 0 <= estimator.settings.gain <= 0x40000000; */
    /*@ assert 0x10000 <= estimator.settings.correlation <= 0x80000000; */
    /*@ assert 1 <= estimator.settings.step_limit <= 58982; */
    /*@ assert 0 <= estimator.settings.kappa_min <= 0x40000000; */
    /*@ assert estimator.settings.noise_margin <= 0x40000000; */
    /*@ assert estimator.settings.dead_zone <= 0x640000; */
    /*@ assert 1 <= estimator.divider; */
    /*@ assert 1 <= estimator.information.block <= 64 && 1 <= estimator.information.retention; */
}

static void any_row(const pvid_model_q31 *model, uint8_t kind)
{
    pvid_estimator_q31 estimator;
    int32_t n[PVID_MAX_THETA_Q31];
    any_state(model, &estimator);
    for (size_t i = 0; i < model->n_theta; i++) {
        n[i] = any_i32(INT32_MIN, INT32_MAX);
    }
    (void)pvid_estimator_add_kind_q31(&estimator, kind, n, any_i32(INT32_MIN, INT32_MAX));
    /*@ assert 0 <= estimator.group_rss <= 0x4000000000000000; */
    /*@ assert 0 <= estimator.information.sums[estimator.information.n_sums - 2]; */
}

static void any_compensation(const pvid_model_q31 *model)
{
    pvid_estimator_q31 estimator;
    pvid_scaled_q31 g[PVID_MAX_THETA_Q31];
    any_state(model, &estimator);
    for (size_t i = 0; i < model->n_theta; i++) {
        g[i].m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        g[i].e = any_i32(-1000, 1000);
    }
    (void)pvid_estimator_add_to_b_q31(&estimator, g);
}

void main(void)
{
    const pvid_model_q31 *const models[3] = {&dense, &blocks, &numbers};
    for (size_t i = 0; i < 3u; i++) {
        for (uint8_t placed = 0; placed < models[i]->n_p; placed++) {
            any_configuration(models[i], placed);
        }
        for (uint8_t kind = 0; kind <= pvid_kinds_count(models[i]->n_kinds); kind++) { /* and one that there is not */
            any_row(models[i], kind);
        }
        any_compensation(models[i]);
    }
}
