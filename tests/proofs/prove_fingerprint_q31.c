/* fingerprint_q31, fnv_q31: any configuration that the strong form takes, a bank of the greatest extent; any state of
 * an estimator of any size. */
#include "prove.h"

#include "persist/fingerprint_q31.h"
#include "pvid/fnv_q31.h"

#define BANK_HALF_MAX ((PVID_MAX_WINDOW - 1) / 2)

static int32_t weights[PVID_ORDERS * BANK_HALF_MAX];
static pvid_strong_config_q31 strong;
static pvid_estimator_q31 estimator;
static const pvid_model_q31 most = {.n_theta = PVID_MAX_THETA_Q31, .n_p = PVID_MAX_P};
static const pvid_model_q31 few = {.n_theta = 5, .n_p = 3};

/* Any bytes in an object. */
#define ANY(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

static void any_strong(void)
{
    ANY(weights);
    ANY(strong);
    strong.bank.half = (uint16_t)any_u32(2, BANK_HALF_MAX);
    strong.bank.weights = weights;
    (void)pvid_fingerprint_strong_q31(&strong);
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
    any_strong();
    any_estimator(&most);
    any_estimator(&few);
}
