/* trust_q31: any configuration; any group of any reason, any estimate within its bounds, on top of any state that the
 * functions keep. */
#include "prove.h"

#include "contracts.h"

#include "judge/standing.h"
#include "pvid/trust_q31.h"

#define VARIANCE_RATIO_MAX (1000000LL << PVID_VARIANCE_RATIO_BITS)
#define RECENT_MAX 1024000000

static pvid_estimator_q31 estimator;
static const pvid_model_q31 most = {.n_theta = 8, .n_p = PVID_MAX_P, .positive = 7u};
static const pvid_model_q31 few = {.n_theta = 5, .n_p = 3, .positive = 7u};

static int32_t shared[(PVID_MAX_P * (PVID_MAX_P + 1)) / 2];

static void any_estimator(const pvid_model_q31 *model)
{
    estimator.model = model;
    estimator.information.block = (uint16_t)any_u32(1, 64);
    estimator.information.retention = any_i32(1, INT32_MAX);
    for (size_t a = 0; a < PVID_MAX_P; a++) {
        estimator.p[a] = any_i32(-INT32_MAX, INT32_MAX);
        estimator.settings.start_sd[a] = any_i32(1, INT32_MAX);
    }
    Frama_C_make_unknown((char *)&estimator.counters, sizeof estimator.counters);
}

/* What an assessment of p within its bounds gives. */
static void any_estimate(const pvid_model_q31 *model, pvid_estimate_q31 *estimate)
{
    for (size_t a = 0; a < PVID_MAX_P; a++) {
        estimate->p[a] = any_i32((((model->positive >> a) & 1u) != 0u) ? 1 : -INT32_MAX, INT32_MAX);
        estimate->se[a] = any_i32(0, INT32_MAX);
        for (size_t b = 0; b < PVID_MAX_P; b++) {
            estimate->correlation[a][b] = any_i32(INT32_MIN, INT32_MAX);
        }
    }
    estimate->kappa = any_i32(INT32_MIN, INT32_MAX);
    estimate->least_pivot = any_i32(INT32_MIN, INT32_MAX);
    estimate->residual_sd = any_i32(0, INT32_MAX);
    estimate->weight = any_u32(0, UINT32_MAX);
    estimate->misfit = any_i32(0, INT32_MAX);
}

/* As any windows leave it. */
static void any_standing(pvid_standing_judge *judge)
{
    Frama_C_make_unknown((char *)judge, sizeof *judge);
    judge->fits = (uint8_t)any_u32(0, 32);
    judge->fit = any_u32(0, PVID_STANDING_CLIP);
    judge->square = any_u32(0, 3u * PVID_STANDING_CLIP);
    judge->contradicts = any_bool();
    judge->grew = any_bool();
    judge->misfit = any_bool();
    judge->rejects = any_bool();
    judge->opened = any_bool();
}

/* A verdict after none, or some, that had a residual. */
static void any_group(const pvid_model_q31 *model, uint16_t least, uint16_t most)
{
    pvid_trust_q31 trust;
    pvid_estimate_q31 candidate;
    pvid_trust_config_q31 config;
    Frama_C_make_unknown((char *)&config, sizeof config);
    Frama_C_make_unknown((char *)shared, sizeof shared);
    config.shared = any_bool() ? shared : NULL;
    any_estimator(model);
    if (pvid_trust_init_q31(&trust, &config, &estimator) != PVID_OK) {
        return;
    }
    /*@ assert trust.long_memory >= 1; */
    pvid_trust_place_q31(&trust, &estimator);
    trust.groups = (uint16_t)any_u32(0, UINT16_MAX);
    trust.uninformative = (uint16_t)any_u32(0, UINT16_MAX);
    trust.judged = (uint16_t)any_u32(least, most);
    trust.next = (uint8_t)any_u32(0, PVID_TRUST_SHORT - 1);
    trust.groups_to_fade = (uint8_t)any_u32(0, UINT8_MAX);
    trust.errors_small = any_bool();
    trust.converged = any_bool();
    trust.published = any_bool();
    trust.misfit = any_bool();
    trust.long_mean = any_i64(-VARIANCE_RATIO_MAX, VARIANCE_RATIO_MAX);
    for (size_t i = 0; i < PVID_TRUST_SHORT; i++) {
        trust.recent[i] = any_i32(-RECENT_MAX, RECENT_MAX);
    }
    any_standing(&trust.standing);
    for (size_t a = 0; a < PVID_MAX_P; a++) {
        trust.trusted[a] = any_i32(-INT32_MAX, INT32_MAX);
        trust.anchor[a] = any_i32(-INT32_MAX, INT32_MAX);
    }
    trust.anew = any_bool();
    pvid_trust_begin_anew_q31(&trust, &estimator);
    const int32_t fading = pvid_trust_fade_factor_q31(&trust);
    /*@ assert 0 <= fading; */
    any_estimate(model, &candidate);
    (void)pvid_trust_judge_q31(&trust, &estimator, (pvid_reason)any_i32(PVID_UPDATED, PVID_HELD_FROZEN),
                               any_i64(0, (int64_t)1 << 62), any_bool(), any_i64(-INT64_MAX, INT64_MAX),
                               (uint16_t)any_u32(1, UINT16_MAX), &candidate);
    int32_t p[PVID_MAX_P];
    pvid_trust_skip_q31(&trust, any_bool());
    (void)pvid_trust_start_q31(&trust, &estimator, PVID_UPDATED, p);
    /*@ assert -VARIANCE_RATIO_MAX <= trust.long_mean <= VARIANCE_RATIO_MAX; */
    /*@ assert \forall integer i; 0 <= i < PVID_TRUST_SHORT ==> trust.recent[i] >= -RECENT_MAX; */
    /*@ assert \forall integer i; 0 <= i < PVID_TRUST_SHORT ==> trust.recent[i] <= RECENT_MAX; */
    /*@ assert trust.next < PVID_TRUST_SHORT; */
}

void main(void)
{
    const pvid_model_q31 *const models[2] = {&most, &few};
    for (size_t i = 0; i < 2u; i++) {
        any_group(models[i], 0, 0);
        any_group(models[i], 1, UINT16_MAX);
    }
}
