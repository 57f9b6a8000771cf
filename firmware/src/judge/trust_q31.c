#include "pvid/trust_q31.h"

#include <stddef.h>
#include <string.h>

#include "number/count.h"
#include "number/fingerprint_numbers_q31.h"
#include "solve/state_q31.h"
#include "judge/publication.h"
#include "judge/standing.h"
#include "judge/trust_q31.h"
#include "judge/verdict.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"

/* p has arrived if its last step, relative, is at most this part of the largest relative standard error, or 1e-4. */
#define ARRIVED 19661 /* 0.3, Q16 */
#define SMALL_STEP (((int64_t)1 << PVID_SIZE_BITS) / 10000)

/* p has settled if its last step, relative, is smaller than 2 %. It has converged if its relative standard errors are
 * at most 10 % as well. */
#define SETTLED_STEP (((int64_t)1 << PVID_SIZE_BITS) / 50)
#define SMALL_ERROR (((int64_t)1 << ERROR_BITS) / 10)

/* A renewal multiplies the sums by FADE before each of the next FADE_GROUPS groups: 0.8 % of them remains. */
#define FADE 644245094 /* 0.3, Q31 */
#define FADE_GROUPS 4u

/* What remains of the sums when they begin anew: nothing that counts, but a system that can be solved. */
#define REMAINS 214748 /* 1e-4, Q31 */

#define CHANCE_MAX 92682 /* sqrt(2), Q16: of one degree of freedom */

const pvid_trust_config_q31 pvid_trust_defaults_q31 = {
    .kappa_min = 32212,   /* 3e-5 */
    .se_max = 838861,     /* 5 % */
    .misfit_max = 262144, /* 4 */
    .groups_min = 3,
    .revert_after = 16,
    .age_max = 1000,
    .renewal = 13107, /* 20 % */
    .shared = NULL,
};

#define RENEWAL_MIN 655u /* 0.01, Q16 */
#define RENEWAL_MAX ((uint32_t)1000 << 16)

/* Most groups in the alarm's long mean; with forgetting it is as long as the memory of the sums. */
#define LONG_MEMORY 4096u

/* Limit of a group's variance ratio: a single group must not outweigh thousands. */
#define VARIANCE_RATIO_MAX ((int64_t)1000000 << PVID_VARIANCE_RATIO_BITS)

#define COARSER 14u     /* bits that a variance ratio of the short mean is rounded to: 32 hold it */
#define SHARED_BITS 24u /* of a relative shared error */
#define ERROR_BITS 24   /* of se_max */

static pvid_status config_is_valid(const pvid_trust_config_q31 *config)
{
    if ((config->kappa_min < 0) || (config->kappa_min > (PVID_ONE_Q30 - (PVID_ONE_Q30 / 1000)))) {
        return PVID_BAD_PUBLISH_KAPPA;
    }
    if (config->se_max <= 0) {
        return PVID_BAD_SE_MAX;
    }
    if ((config->misfit_max != 0u) && (config->misfit_max < ((uint32_t)1 << 16))) {
        return PVID_BAD_MISFIT_MAX;
    }
    if ((config->renewal != 0u) && ((config->renewal < RENEWAL_MIN) || (config->renewal > RENEWAL_MAX))) {
        return PVID_BAD_RENEWAL;
    }
    return PVID_OK;
}

PVID_COLD bool pvid_trust_shared_are_valid_q31(const int32_t shared[], size_t n_p)
{
    bool valid = true;
    const size_t count = (shared != NULL) ? n_p : 0u;
    size_t k = 0;
    for (size_t a = 0; a < count; a++) {
        valid = valid && (shared[k] >= 0);
        k++;
        for (size_t b = a + 1u; b < n_p; b++) {
            valid = valid && (pvid_magnitude_q31(shared[k]) <= (uint64_t)PVID_ONE_Q30);
            k++;
        }
    }
    return valid;
}

void pvid_trust_place_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator)
{
    pvid_publication_write(&self->mark, self->estimate.p, self->copy.p, estimator->p, sizeof self->estimate.p,
                           self->mark.number[0]);
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    memcpy(self->trusted, estimator->p, sizeof self->trusted);
}

pvid_status pvid_trust_init_q31(pvid_trust_q31 *self, const pvid_trust_config_q31 *config,
                                const pvid_estimator_q31 *estimator)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (estimator != NULL));
    if ((self == NULL) || (config == NULL) || (estimator == NULL)) {
        return PVID_BAD_POINTER;
    }
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    if (!pvid_trust_shared_are_valid_q31(config->shared, estimator->model->n_p)) {
        return PVID_BAD_SHARED;
    }
    memset(self, 0, sizeof *self);
    self->config = *config;
    const uint64_t fading = ((uint64_t)1 << 31) - (uint64_t)estimator->information.retention;
    const uint64_t groups = ((uint64_t)estimator->information.block << 31) / fading; /* of memory; all but never ends */
    const uint64_t clamped = (groups < LONG_MEMORY) ? groups : LONG_MEMORY;
    self->long_memory = (uint16_t)((clamped < PVID_TRUST_LONG) ? PVID_TRUST_LONG : clamped);
    pvid_trust_place_q31(self, estimator);
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        self->estimate.se[a] = estimator->settings.start_sd[a];
        self->estimate.correlation[a][a] = PVID_ONE_Q30;
    }
    self->copy = self->estimate;
    return PVID_OK;
}

const int32_t *pvid_trust_fallback_q31(const pvid_trust_q31 *self)
{
    return ((self->config.revert_after > 0u) && (self->uninformative >= self->config.revert_after)) ? self->estimate.p
                                                                                                    : NULL;
}

/* ---- the alarm ---- */

/* Adds a group's variance ratio to the short and the long mean. Returns whether one of them exceeds its limit. */
static bool add_variance_ratio(pvid_trust_q31 *self, int64_t variance_ratio)
{
    const int64_t x = pvid_clamp_q31(variance_ratio, VARIANCE_RATIO_MAX);
    if (self->judged < self->long_memory) {
        self->judged++;
    }
    self->long_mean =
        pvid_clamp_q31(self->long_mean + ((x - self->long_mean) / (int64_t)self->judged), VARIANCE_RATIO_MAX);
    self->recent[self->next] = (int32_t)pvid_round_shift_q31(x, COARSER);
    self->next = (uint8_t)((self->next + 1u == PVID_TRUST_SHORT) ? 0u : (self->next + 1u));
    int64_t sum = 0;
    for (size_t i = 0; i < PVID_TRUST_SHORT; i++) {
        sum += self->recent[i];
    }
    const int64_t limit = (int64_t)self->config.misfit_max << (PVID_VARIANCE_RATIO_BITS - 16);
    const int64_t coarse = (int64_t)(self->config.misfit_max >> (COARSER - (PVID_VARIANCE_RATIO_BITS - 16u)));
    const bool short_exceeds =
        (self->judged >= PVID_TRUST_SHORT) && ((2 * sum) > (3 * (coarse * (int64_t)PVID_TRUST_SHORT)));
    const bool long_exceeds = (self->judged >= PVID_TRUST_LONG) && (self->long_mean > limit);
    return short_exceeds || long_exceeds;
}

static void restart_alarm(pvid_trust_q31 *self)
{
    self->judged = 0;
    self->next = 0;
    self->long_mean = 0;
    memset(self->recent, 0, sizeof self->recent);
}

/* Returns whether the residual variance of all rows is within misfit_max, with three standard deviations of chance. */
static bool all_rows_agree(const pvid_trust_q31 *self, const pvid_estimator_q31 *estimator,
                           const pvid_estimate_q31 *candidate)
{
    const uint32_t n_p = estimator->model->n_p;
    const uint32_t freedom = (candidate->weight > n_p) ? (candidate->weight - n_p) : 1u;
    const uint64_t square = pvid_quotient_q31((uint64_t)1 << 33, freedom); /* 2 / freedom, Q32 */
    const int64_t root = (int64_t)pvid_square_root_q31(square);
    const int64_t chance = pvid_clamp_q31(root, CHANCE_MAX);
    const int64_t limit = (int64_t)self->config.misfit_max * (((int64_t)1 << 16) + (3 * chance)); /* Q32 */
    return ((int64_t)candidate->misfit * ((int64_t)1 << 16)) <= limit;
}

/* ---- the gate ---- */

/* Largest standard error of the positive parameters, relative to them, Q24. */
static int64_t largest_error(const pvid_estimator_q31 *estimator, const pvid_estimate_q31 *candidate)
{
    int64_t most = 0;
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        if (pvid_is_positive_q31(estimator->model, a)) {
            const uint64_t error = (uint64_t)candidate->se[a] << ERROR_BITS;
            const int64_t relative = (int64_t)pvid_quotient_q31(error, (uint32_t)candidate->p[a]);
            most = (relative > most) ? relative : most;
        }
    }
    return most;
}

/* ---- renewal ---- */

void pvid_trust_begin_anew_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator)
{
    self->anew = true;
    self->groups = 0;
    self->groups_to_fade = 0;
    self->converged = false;
    self->arrived = false;
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    restart_alarm(self);
}

int32_t pvid_trust_fade_factor_q31(pvid_trust_q31 *self)
{
    if (self->anew) {
        self->anew = false;
        return REMAINS;
    }
    if ((self->groups_to_fade == 0u) || !self->errors_small) {
        return 0;
    }
    self->groups_to_fade--;
    return FADE;
}

/* Returns whether a positive parameter differs from the anchor by more than `renewal`, relative. */
static bool has_moved(const pvid_trust_q31 *self, const pvid_estimator_q31 *estimator)
{
    bool moved = false;
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        if (pvid_is_positive_q31(estimator->model, a)) {
            const int64_t way = (int64_t)pvid_magnitude_q31((int64_t)estimator->p[a] - self->anchor[a]);
            moved = moved || ((way * ((int64_t)1 << 16)) > ((int64_t)self->anchor[a] * self->config.renewal));
        }
    }
    return moved;
}

/* For a settled p: renews the sums if they are stale. If the rows agree with p, p becomes the anchor. If the standard
 * errors are large, p has not converged. */
static void renew_if_stale(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, bool agrees)
{
    if (!agrees && has_moved(self, estimator)) {
        self->groups_to_fade = FADE_GROUPS;
        restart_alarm(self);
        memcpy(self->anchor, estimator->p, sizeof self->anchor);
    }
    if (agrees) {
        memcpy(self->anchor, estimator->p, sizeof self->anchor);
    }
}

/* Sets the alarm and renews the sums if they are stale. `settled`: the last step was small; error: the largest relative
 * standard error. */
static void raise_alarm(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, bool settled, int64_t variance_ratio,
                        int64_t error, const pvid_estimate_q31 *candidate)
{
    const bool agrees = all_rows_agree(self, estimator, candidate);
    const bool errors_small = error <= SMALL_ERROR;
    const bool renewing = self->groups_to_fade > 0u;
    self->errors_small = errors_small;
    bool short_exceeds = false;
    if (renewing) {
        restart_alarm(self);
    } else if (self->converged) {
        short_exceeds = add_variance_ratio(self, variance_ratio);
    } else {
        self->converged = settled && errors_small && (self->groups >= self->config.groups_min);
    }
    self->misfit = (self->config.misfit_max > 0u) && (!agrees || short_exceeds);
    if (settled && errors_small && !renewing && (self->config.renewal > 0u)) {
        renew_if_stale(self, estimator, agrees);
    }
}

/* Whether the last step was small beside the largest relative error. */
static bool has_arrived(int64_t size, int64_t error)
{
    const int64_t clamped = pvid_clamp_q31(error, (int64_t)1 << 44);
    const int64_t small_enough = pvid_round_shift_q31(clamped * ARRIVED, 16u + (ERROR_BITS - PVID_SIZE_BITS));
    return size <= ((small_enough > SMALL_STEP) ? small_enough : SMALL_STEP);
}

static pvid_reason verdict(const pvid_trust_q31 *self, pvid_reason reason, int64_t error, bool above_noise,
                           const pvid_estimate_q31 *candidate)
{
    if (reason != PVID_UPDATED) {
        return reason;
    }
    if (!above_noise || (candidate->kappa < self->config.kappa_min) ||
        (candidate->least_pivot < self->config.kappa_min)) {
        return PVID_HELD_NOT_EXCITED;
    }
    if ((self->groups < self->config.groups_min) || (error > self->config.se_max) || !self->arrived ||
        self->standing.opened) {
        return PVID_HELD_UNCERTAIN;
    }
    return PVID_UPDATED;
}

/* x / y in Q30, 0 <= x <= y; 1 where y is 0. */
PVID_COLD static int64_t part_of(int64_t x, int64_t y)
{
    return (y > 0) ? pvid_clamp_q31((x * PVID_ONE_Q30) / y, PVID_ONE_Q30) : PVID_ONE_Q30;
}

/* With se'^2 = se^2 + e^2 of errors e, a correlation becomes
 * (se_a se_b correlation + e_a e_b shared correlation) / (se'_a se'_b). */
PVID_COLD void pvid_trust_add_shared_q31(const int32_t shared[], const pvid_model_q31 *model,
                                         pvid_estimate_q31 *candidate)
{
    if (shared == NULL) {
        return;
    }
    const size_t n_p = model->n_p;
    int64_t own[PVID_MAX_P];  /* se / se', Q30 */
    int64_t more[PVID_MAX_P]; /* e / se', Q30 */
    size_t k = 0;
    for (size_t a = 0; a < n_p; a++) {
        int64_t error = (shared[k] > 0) ? shared[k] : 0;
        if (pvid_is_positive_q31(model, a)) {
            error = pvid_clamp_q31(pvid_round_shift_q31(error * candidate->p[a], SHARED_BITS), INT32_MAX);
        }
        const int64_t before = candidate->se[a];
        const int64_t square = pvid_clamp_q31((before * before) + (error * error), (int64_t)1 << 62);
        const int64_t after = pvid_clamp_q31((int64_t)pvid_square_root_q31((uint64_t)square), INT32_MAX);
        own[a] = part_of(before, after);
        more[a] = (after > 0) ? part_of(error, after) : 0;
        candidate->se[a] = (int32_t)after;
        k += n_p - a;
    }
    k = 0;
    for (size_t a = 0; a < n_p; a++) {
        k++;
        for (size_t b = a + 1u; b < n_p; b++) {
            const int64_t part = pvid_round_shift_q31(own[a] * own[b], 30u) * candidate->correlation[a][b];
            const int64_t common = pvid_round_shift_q31(more[a] * more[b], 30u) * shared[k];
            const int64_t sum = pvid_round_shift_q31(part, 30u) + pvid_round_shift_q31(common, 30u);
            candidate->correlation[a][b] = (int32_t)pvid_clamp_q31(sum, PVID_ONE_Q30);
            candidate->correlation[b][a] = candidate->correlation[a][b];
            k++;
        }
    }
}

pvid_reason pvid_trust_decide_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, pvid_reason reason,
                                  int64_t size, bool above_noise, int64_t variance_ratio,
                                  const pvid_estimate_q31 *candidate)
{
    pvid_count_up_16(&self->groups);
    if (reason == PVID_ACCUMULATED) { /* no solve was due */
        return reason;
    }
    pvid_trust_count_uninformative(&self->uninformative, reason, pvid_trust_fallback_q31(self) != NULL);
    const int64_t error = largest_error(estimator, candidate);
    self->arrived = (reason == PVID_UPDATED) && has_arrived(size, error);
    raise_alarm(self, estimator, (reason == PVID_UPDATED) && (size <= SETTLED_STEP), variance_ratio, error, candidate);
    return verdict(self, reason, error, above_noise, candidate);
}

/* ---- the standing ---- */

/* The standing to the published estimate, which stays. */
static void share_standing(pvid_trust_q31 *self)
{
    pvid_publication_write(&self->mark, &self->estimate.standing, &self->copy.standing, &self->standing.now,
                           sizeof self->standing.now, self->mark.number[0]);
}

void pvid_trust_open_q31(pvid_trust_q31 *self)
{
    self->standing.opened = true;
}

void pvid_trust_skip_q31(pvid_trust_q31 *self, bool rejected)
{
    pvid_standing_skip(&self->standing, rejected, self->config.age_max);
    share_standing(self);
}

/* Whether the candidate differs from the published estimate, and whether its standard errors have grown. */
PVID_COLD static void compare(pvid_trust_q31 *self, size_t n_p, const pvid_estimate_q31 *candidate)
{
    bool differs = false;
    bool grew = false;
    for (size_t a = 0; self->published && (a < n_p); a++) {
        const int64_t se = candidate->se[a];
        const int64_t held = self->own[a];
        const int64_t way = (int64_t)pvid_magnitude_q31((int64_t)candidate->p[a] - self->estimate.p[a]);
        const int64_t part = way / PVID_STANDING_AWAY; /* below 2^30 */
        differs = differs || ((part * part) > ((se * se) + (held * held)));
        grew = grew || (se > (PVID_STANDING_GROWN * held));
    }
    self->standing.contradicts = differs;
    self->standing.grew = grew;
}

PVID_COLD void pvid_trust_stand_q31(pvid_trust_q31 *self, pvid_reason judged, pvid_reason reason,
                                    int64_t variance_ratio, uint16_t freedom, bool errs, uint32_t own,
                                    const pvid_estimate_q31 *candidate)
{
    const int64_t most = (int64_t)PVID_STANDING_CLIP << (PVID_VARIANCE_RATIO_BITS - 16);
    const int64_t ratio = pvid_clamp_q31(variance_ratio, most);
    pvid_standing_window window;
    window.published = judged == PVID_UPDATED;
    window.solved = reason == PVID_UPDATED;
    window.arrived = self->arrived;
    window.judges = self->config.misfit_max > 0u;
    window.freedom = freedom;
    window.age_max = self->config.age_max;
    window.errs = errs;
    window.own = own;
    window.ratio = (uint32_t)pvid_round_shift_q31((ratio > 0) ? ratio : 0, PVID_VARIANCE_RATIO_BITS - 16u);
    if (pvid_standing_take(&self->standing, &window)) {
        memcpy(self->trusted, candidate->p, sizeof self->trusted);
    }
}

PVID_COLD bool pvid_trust_start_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, pvid_reason reason,
                                    int32_t p[PVID_MAX_P])
{
    uint8_t number = 0;
    const bool starts = pvid_standing_starts(&self->standing, reason == PVID_UPDATED, &number);
    share_standing(self);
    for (size_t a = 0; starts && (a < estimator->model->n_p); a++) {
        const int64_t x = 3 * (int64_t)pvid_standing_spread(number, (uint32_t)a);
        const int64_t whole = (self->trusted[a] * (65536 + x)) / (262144 - x);
        p[a] = pvid_is_positive_q31(estimator->model, a) ? (int32_t)pvid_clamp_q31(whole, INT32_MAX) : self->trusted[a];
    }
    return starts;
}

pvid_reason pvid_trust_publish_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason judged,
                                   pvid_reason reason, pvid_estimate_q31 *candidate)
{
    if (reason == PVID_UPDATED) {
        compare(self, estimator->model->n_p, candidate);
    }
    if (judged == PVID_UPDATED) {
        uint32_t number = self->mark.number[0];
        pvid_count_up(&number);
        candidate->standing = self->standing.now;
        candidate->standing.age = 0;
        memcpy(self->own, candidate->se, sizeof self->own);
        pvid_trust_add_shared_q31(self->config.shared, estimator->model, candidate);
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, candidate, sizeof *candidate, number);
        self->published = true;
    }
    return pvid_trust_report(&estimator->counters, judged, reason, self->misfit);
}

pvid_reason pvid_trust_judge_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason reason, int64_t size,
                                 bool above_noise, int64_t variance_ratio, uint16_t freedom,
                                 pvid_estimate_q31 *candidate)
{
    const pvid_reason judged =
        pvid_trust_decide_q31(self, estimator, reason, size, above_noise, variance_ratio, candidate);
    const pvid_reason reported = pvid_trust_publish_q31(self, estimator, judged, reason, candidate);
    pvid_trust_stand_q31(self, judged, reason, variance_ratio, freedom, false, 0, candidate);
    return reported;
}

uint32_t pvid_fingerprint_trust_q31(uint32_t hash, const pvid_trust_config_q31 *config, size_t n_p)
{
    const int32_t limits[] = {config->kappa_min, config->se_max};
    uint32_t running = pvid_fingerprint_words(hash, limits, sizeof limits / sizeof limits[0]);
    running = pvid_fnv_word(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    running = pvid_fnv_word(running, config->age_max);
    running = pvid_fnv_word(running, config->renewal);
    return pvid_fingerprint_words(running, config->shared, (config->shared != NULL) ? ((n_p * (n_p + 1u)) / 2u) : 0u);
}
