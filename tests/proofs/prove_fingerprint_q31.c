/* fingerprint_q31, fnv_q31: any configuration that the forms take, tables of the greatest extents; any state of an
 * estimator of any size. */
#include "prove.h"

#include "keep/fingerprint_q31.h"
#include "pvid/fnv_q31.h"

#define HALF_MAX ((PVID_MAX_TAPS - 1) / 2)
#define BANK_HALF_MAX ((PVID_MAX_WINDOW - 1) / 2)
#define GRAM_MAX ((PVID_WEAK_GRAMS / 2) * PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1))

static int32_t smooth[HALF_MAX];
static int16_t chi[PVID_MAX_WEAK_WINDOW * 3 * PVID_MAX_FUNCTIONS];
static int32_t gram[GRAM_MAX];
static int32_t multiplier[PVID_WEAK_TERMS_Q31];
static int32_t weights[PVID_ORDERS * BANK_HALF_MAX];
static pvid_weak_design_q31 design;
static pvid_weak_config_q31 weak;
static pvid_strong_config_q31 strong;
static pvid_estimator_q31 estimator;

/* Any bytes in an object. */
#define ANY(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

static void any_weak(void)
{
    ANY(smooth);
    ANY(chi);
    ANY(gram);
    ANY(multiplier);
    ANY(design);
    ANY(weak);
    design.taps = (uint16_t)any_u32(5, PVID_MAX_TAPS);
    design.window = (uint16_t)any_u32(9, PVID_MAX_WEAK_WINDOW);
    design.functions = (uint8_t)any_u32(4, PVID_MAX_FUNCTIONS);
    design.smooth = smooth;
    design.second = smooth;
    design.chi = chi;
    design.multiplier = multiplier;
    design.gram = gram;
    weak.design = &design;
    weak.zero_unknown = any_bool();
    (void)pvid_fingerprint_weak_q31(&weak);
}

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
    any_weak();
    any_strong();
    any_estimator(&pvid_kapitza_weak_q31);
    any_estimator(&pvid_kapitza_weak_zeroed_q31);
}
