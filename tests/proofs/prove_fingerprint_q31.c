/* fingerprint_numbers_q31, gate_q31, settings_q31, fnv_q31: any settings of a gate and of an estimator with as many
 * entries as there is room for, or fewer; any state of an estimator of any size. */
#include "prove.h"

#include "judge/gate_q31.h"
#include "pvid/fnv_q31.h"
#include "solve/settings_q31.h"

static pvid_gate_config_q31 gate;
static pvid_estimator_config_q31 settings;
static pvid_estimator_q31 estimator;
static const pvid_model_q31 most = {.n_theta = PVID_MAX_THETA_Q31, .n_p = PVID_MAX_P};
static const pvid_model_q31 few = {.n_theta = 5, .n_p = 3};

/* Any bytes in an object. */
#define ANY(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

static void any_settings(const pvid_model_q31 *model)
{
    ANY(gate);
    ANY(settings);
    const uint32_t hash = pvid_fingerprint_gate_q31((uint32_t)any_u32(0, UINT32_MAX), &gate);
    (void)pvid_fingerprint_estimator_q31(hash, &settings, model->n_theta, model->n_p);
}

static void any_estimator(const pvid_model_q31 *model)
{
    ANY(estimator);
    estimator.model = model;
    estimator.information.n_sums = (uint16_t)any_u32(1, PVID_MAX_SUMS_Q31);
    (void)pvid_fnv_estimator_q31((uint32_t)any_u32(0, UINT32_MAX), &estimator, (pvid_reason)any_i32(0, 20));
}

void main(void)
{
    any_settings(&most);
    any_settings(&few);
    any_estimator(&most);
    any_estimator(&few);
}
