#include "number/uncontracted.h"

#include "pvid/trust.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "number/count.h"
#include "number/fingerprint_numbers_f32.h"
#include "solve/settings_f32.h"
#include "solve/staged_f32.h"
#include "solve/state_f32.h"
#include "number/finite_f32.h"
#include "judge/publication.h"
#include "judge/standing.h"
#include "judge/trust_f32.h"
#include "judge/verdict.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"

const pvid_trust_config_f32 pvid_trust_defaults_f32 = {
    .kappa_min = 3.0e-5f,
    .se_max = 0.05f,
    .misfit_max = 4.0f,
    .groups_min = 3,
    .revert_after = 16,
    .age_max = 1000,
    .renewal = 0.2f,
    .shared = NULL,
};

/* p has arrived if its last step, relative, is at most this part of the largest relative standard error, or 1e-4. */
#define ARRIVED 0.3f
#define SMALL_STEP 1.0e-4f

/* p has settled if its last step, relative, is smaller than this. */
#define SETTLED_STEP 0.02f

/* Relative standard errors up to this are small: p has converged if it has settled and they are small. */
#define SMALL_ERROR 0.1f

/* A renewal multiplies the sums by FADE before each of the next FADE_GROUPS groups: 0.8 % of them remains. */
#define FADE 0.3f
#define FADE_GROUPS 4u

/* What remains of the sums when they begin anew: nothing that counts, but a system that can be solved. */
#define REMAINS 1.0e-4f

/* Most groups in the alarm's long mean; with forgetting it is as long as the memory of the sums. */
#define LONG_MEMORY 4096.0f

/* Limit of a group's variance ratio: a single group must not outweigh thousands. */
#define VARIANCE_RATIO_MAX 1.0e6f

/* Largest variance with shared errors: a covariance of two such is finite. */
#define VARIANCE_MAX 1.0e36f

PVID_COLD static pvid_status config_is_valid(const pvid_trust_config_f32 *config)
{
    /* in the order of `values` */
    static const pvid_range_f32 ranges[] = {
        {0.0f, 0.999f, PVID_BAD_PUBLISH_KAPPA, false},
        {1.0e-9f, 1.0e9f, PVID_BAD_SE_MAX, false},
        {1.0f, 1.0e6f, PVID_BAD_MISFIT_MAX, true},
        {0.01f, 1.0e3f, PVID_BAD_RENEWAL, true},
    };
    const float values[] = {config->kappa_min, config->se_max, config->misfit_max, config->renewal};
    return pvid_settings_within_f32(values, ranges, sizeof values / sizeof values[0]);
}

PVID_COLD bool pvid_trust_shared_are_valid_f32(const float shared[], size_t n_p)
{
    bool valid = (shared == NULL) || (PVID_SHARED != 0);
    const size_t count = (shared != NULL) ? n_p : 0u;
    size_t k = 0;
    for (size_t a = 0; a < count; a++) {
        for (size_t b = a; b < n_p; b++) {
            valid = valid && pvid_within_f32(shared[k], (a == b) ? 0.0f : -1.0f, (a == b) ? 1.0e9f : 1.0f);
            k++;
        }
    }
    return valid;
}

PVID_COLD static void publish_start(pvid_estimate_f32 *estimate, const pvid_estimator_f32 *estimator)
{
    memcpy(estimate->p, estimator->p, sizeof estimate->p);
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        estimate->se[a] = estimator->settings.start_sd[a];
        estimate->covariance[a][a] = estimator->settings.start_sd[a] * estimator->settings.start_sd[a];
    }
}

void pvid_trust_place_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator)
{
    pvid_publication_write(&self->mark, self->estimate.p, self->copy.p, estimator->p, sizeof self->estimate.p,
                           self->mark.number[0]);
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    memcpy(self->trusted, estimator->p, sizeof self->trusted);
}

PVID_COLD pvid_status pvid_trust_init_f32(pvid_trust_f32 *self, const pvid_trust_config_f32 *config,
                                          const pvid_estimator_f32 *estimator)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (estimator != NULL));
    if ((self == NULL) || (config == NULL) || (estimator == NULL)) {
        return PVID_BAD_POINTER;
    }
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    if (!pvid_trust_shared_are_valid_f32(config->shared, estimator->model->n_p)) {
        return PVID_BAD_SHARED;
    }
    memset(self, 0, sizeof *self);
    self->config = *config;
    const pvid_information_f32 *sums = &estimator->information;
    float memory = LONG_MEMORY;
    if (sums->retention < 1.0f) {
        const float groups = (float)sums->block / (1.0f - sums->retention);
        memory = (groups < LONG_MEMORY) ? groups : LONG_MEMORY;
    }
    self->long_memory = (uint16_t)((memory < (float)PVID_TRUST_LONG) ? (float)PVID_TRUST_LONG : memory);
    publish_start(&self->estimate, estimator);
    self->copy = self->estimate;
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    memcpy(self->trusted, estimator->p, sizeof self->trusted);
    return PVID_OK;
}

const float *pvid_trust_fallback_f32(const pvid_trust_f32 *self)
{
    return ((self->config.revert_after > 0u) && (self->uninformative >= self->config.revert_after)) ? self->estimate.p
                                                                                                    : NULL;
}

/* ---- the alarm ---- */

/* Adds a group's variance ratio to the short and the long mean. Returns whether one of them exceeds its limit. */
static bool add_variance_ratio(pvid_trust_f32 *self, float variance_ratio)
{
    const float x =
        (variance_ratio <= VARIANCE_RATIO_MAX) ? variance_ratio : VARIANCE_RATIO_MAX; /* NaN becomes the limit */
    if (self->judged < self->long_memory) {
        self->judged++;
    }
    self->long_mean += (x - self->long_mean) / (float)self->judged;
    self->recent[self->next] = x;
    self->next = (uint8_t)((self->next + 1u == PVID_TRUST_SHORT) ? 0u : (self->next + 1u));
    float sum = 0.0f;
    for (size_t i = 0; i < PVID_TRUST_SHORT; i++) {
        sum += self->recent[i];
    }
    const float limit = self->config.misfit_max;
    const bool short_exceeds = (self->judged >= PVID_TRUST_SHORT) && (sum > (1.5f * (limit * (float)PVID_TRUST_SHORT)));
    const bool long_exceeds = (self->judged >= PVID_TRUST_LONG) && (self->long_mean > limit);
    return short_exceeds || long_exceeds;
}

PVID_COLD static void restart_alarm(pvid_trust_f32 *self)
{
    self->judged = 0;
    self->next = 0;
    self->long_mean = 0.0f;
    memset(self->recent, 0, sizeof self->recent);
}

/* Returns whether the residual variance of all rows is within misfit_max, with three standard deviations of chance. */
static bool all_rows_agree(const pvid_trust_f32 *self, const pvid_estimator_f32 *estimator,
                           const pvid_estimate_f32 *candidate)
{
    const float freedom = candidate->weight - (float)estimator->model->n_p;
    const float chance = sqrtf(2.0f / ((freedom >= 1.0f) ? freedom : 1.0f));
    return candidate->misfit <= (self->config.misfit_max * (1.0f + (3.0f * chance)));
}

PVID_COLD float pvid_trust_largest_error_f32(const pvid_estimator_f32 *estimator, const pvid_estimate_f32 *candidate)
{
    float largest_error = 0.0f;
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        if (pvid_is_positive_f32(estimator->model, a)) {
            const float relative = candidate->se[a] / candidate->p[a];
            largest_error = (relative <= largest_error) ? largest_error : relative;
        }
    }
    return largest_error;
}

/* ---- renewal ---- */

PVID_COLD void pvid_trust_renew_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator)
{
    self->groups_to_fade = FADE_GROUPS;
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    restart_alarm(self);
}

PVID_COLD void pvid_trust_begin_anew_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator)
{
    self->anew = true;
    self->groups = 0;
    self->groups_to_fade = 0;
    self->converged = false;
    self->arrived = false;
    memcpy(self->anchor, estimator->p, sizeof self->anchor);
    restart_alarm(self);
}

float pvid_trust_fade_factor_f32(pvid_trust_f32 *self)
{
    if (self->anew) {
        self->anew = false;
        return REMAINS;
    }
    if ((self->groups_to_fade == 0u) || !self->errors_small) {
        return 1.0f;
    }
    self->groups_to_fade--;
    return FADE;
}

/* Returns whether a positive parameter differs from the anchor by more than `renewal`, relative. */
static bool has_moved(const pvid_trust_f32 *self, const pvid_estimator_f32 *estimator)
{
    bool moved = false;
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        if (pvid_is_positive_f32(estimator->model, a)) {
            const float part = (estimator->p[a] / self->anchor[a]) - 1.0f;
            moved = moved || (part > self->config.renewal) || (part < -self->config.renewal);
        }
    }
    return moved;
}

/* For a settled p: renews the sums if they are stale. If the rows agree with p, p becomes the anchor. If the standard
 * errors are large, p has not converged. */
PVID_COLD static void renew_if_stale(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator, bool errors_small,
                                     bool agrees)
{
    const bool stale = errors_small && !agrees && has_moved(self, estimator);
    if (stale || pvid_estimator_is_rounded_f32(estimator)) {
        pvid_trust_renew_f32(self, estimator);
    } else if (errors_small && agrees) {
        memcpy(self->anchor, estimator->p, sizeof self->anchor);
    } else {
        /* p has not converged, or has not moved far */
    }
}

/* Sets the alarm and renews the sums if they are stale. `settled`: the last step was small; error: the largest relative
 * standard error. */
PVID_COLD static void raise_alarm(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator, bool settled,
                                  float variance_ratio, float error, const pvid_estimate_f32 *candidate)
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
    self->misfit = (self->config.misfit_max > 0.0f) && (!agrees || short_exceeds);
    if (settled && !renewing && (self->config.renewal > 0.0f)) {
        renew_if_stale(self, estimator, errors_small, agrees);
    }
}

PVID_COLD static pvid_reason verdict_on(const pvid_trust_f32 *self, pvid_reason reason, bool above_noise, float error,
                                        const pvid_estimate_f32 *candidate)
{
    if (reason != PVID_UPDATED) {
        return reason;
    }
    if (!above_noise || !(candidate->kappa >= self->config.kappa_min) ||
        !(candidate->least_pivot >= self->config.kappa_min)) {
        return PVID_HELD_NOT_EXCITED;
    }
    /* too few windows, too large an error, not converged, or sums begun anew by the gate */
    if ((self->groups < self->config.groups_min) || !(error <= self->config.se_max) || !self->arrived ||
        self->standing.opened) {
        return PVID_HELD_UNCERTAIN;
    }
    return PVID_UPDATED;
}

PVID_COLD void pvid_trust_add_shared_f32(const float shared[], size_t n_p, uint32_t positive,
                                         pvid_estimate_f32 *candidate)
{
    if ((PVID_SHARED == 0) || (shared == NULL)) {
        return;
    }
    float error[PVID_MAX_P];
    size_t k = 0;
    for (size_t a = 0; a < n_p; a++) {
        error[a] = shared[k] * ((((positive >> a) & 1u) != 0u) ? candidate->p[a] : 1.0f);
        const float variance = (candidate->se[a] * candidate->se[a]) + (error[a] * error[a]);
        if (variance <= VARIANCE_MAX) {
            candidate->se[a] = sqrtf(variance);
        } else { /* NaN too: as without */
            error[a] = 0.0f;
        }
        k += n_p - a;
    }
    k = 0;
    for (size_t a = 0; a < n_p; a++) {
        candidate->covariance[a][a] += error[a] * error[a];
        k++;
        for (size_t b = a + 1u; b < n_p; b++) {
            const float common = (error[a] * error[b]) * shared[k];
            candidate->covariance[a][b] += common;
            candidate->covariance[b][a] += common;
            k++;
        }
    }
}

PVID_COLD pvid_reason pvid_trust_decide_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator,
                                            pvid_reason reason, float size, bool above_noise, float variance_ratio,
                                            const pvid_estimate_f32 *candidate)
{
    pvid_count_up_16(&self->groups);
    if (reason == PVID_ACCUMULATED) { /* no solve was due */
        return reason;
    }
    pvid_trust_count_uninformative(&self->uninformative, reason, pvid_trust_fallback_f32(self) != NULL);
    const float error = pvid_trust_largest_error_f32(estimator, candidate);
    const bool settled = (reason == PVID_UPDATED) && (size <= SETTLED_STEP);
    const float small_enough = ARRIVED * error;
    self->arrived = (reason == PVID_UPDATED) && (size <= ((small_enough > SMALL_STEP) ? small_enough : SMALL_STEP));
    raise_alarm(self, estimator, settled, variance_ratio, error, candidate);
    return verdict_on(self, reason, above_noise, error, candidate);
}

/* ---- the standing ---- */

/* The standing to the published estimate, which stays. */
PVID_COLD static void share_standing(pvid_trust_f32 *self)
{
    pvid_publication_write(&self->mark, &self->estimate.standing, &self->copy.standing, &self->standing.now,
                           sizeof self->standing.now, self->mark.number[0]);
}

PVID_COLD void pvid_trust_open_f32(pvid_trust_f32 *self)
{
    self->standing.opened = true;
}

PVID_COLD void pvid_trust_skip_f32(pvid_trust_f32 *self, bool rejected)
{
    pvid_standing_skip(&self->standing, rejected, self->config.age_max);
    share_standing(self);
}

PVID_COLD void pvid_trust_compare_f32(pvid_trust_f32 *self, size_t n_p, const pvid_estimate_f32 *candidate)
{
    const float away = (float)(PVID_STANDING_AWAY * PVID_STANDING_AWAY);
    bool differs = false;
    bool grew = false;
    for (size_t a = 0; self->published && (a < n_p); a++) {
        const float held = self->own[a];
        const float joint = (candidate->se[a] * candidate->se[a]) + (held * held);
        const float way = candidate->p[a] - self->estimate.p[a];
        differs = differs || ((way * way) > (away * joint));
        grew = grew || (candidate->se[a] > ((float)PVID_STANDING_GROWN * held));
    }
    self->standing.contradicts = differs;
    self->standing.grew = grew;
}

PVID_COLD void pvid_trust_stand_f32(pvid_trust_f32 *self, pvid_reason verdict, pvid_reason reason, float variance_ratio,
                                    uint16_t freedom, bool errs, uint32_t own, const pvid_estimate_f32 *candidate)
{
    pvid_standing_window window;
    window.published = verdict == PVID_UPDATED;
    window.solved = reason == PVID_UPDATED;
    window.arrived = self->arrived;
    window.judges = self->config.misfit_max > 0.0f;
    window.freedom = freedom;
    window.age_max = self->config.age_max;
    window.errs = errs;
    window.own = own;
    window.ratio = PVID_STANDING_CLIP; /* NaN too */
    if (variance_ratio < (float)(PVID_STANDING_CLIP >> 16u)) {
        window.ratio = (uint32_t)(variance_ratio * 65536.0f);
    }
    if (pvid_standing_take(&self->standing, &window)) {
        memcpy(self->trusted, candidate->p, sizeof self->trusted);
    }
}

PVID_COLD bool pvid_trust_start_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator, pvid_reason reason,
                                    float p[PVID_MAX_P])
{
    uint8_t number = 0;
    const bool starts = pvid_standing_starts(&self->standing, reason == PVID_UPDATED, &number);
    share_standing(self);
    for (size_t a = 0; starts && (a < estimator->model->n_p); a++) {
        const uint32_t x = 3u * pvid_standing_spread(number, (uint32_t)a);
        const float factor = (float)(65536u + x) / (float)(262144u - x);
        p[a] = pvid_is_positive_f32(estimator->model, a) ? (factor * self->trusted[a]) : self->trusted[a];
    }
    return starts;
}

PVID_COLD pvid_reason pvid_trust_publish_f32(pvid_trust_f32 *self, pvid_estimator_f32 *estimator, pvid_reason verdict,
                                             pvid_reason reason, pvid_estimate_f32 *candidate)
{
    if (verdict == PVID_UPDATED) {
        uint32_t number = self->mark.number[0];
        pvid_count_up(&number);
        candidate->standing = self->standing.now;
        candidate->standing.age = 0;
        memcpy(self->own, candidate->se, sizeof self->own);
        pvid_trust_add_shared_f32(self->config.shared, estimator->model->n_p, estimator->model->positive, candidate);
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, candidate, sizeof *candidate, number);
        memcpy(candidate->se, self->own, sizeof self->own); /* as the second stage compares them */
        self->published = true;
    }
    return pvid_trust_report(&estimator->counters, verdict, reason, self->misfit);
}

pvid_reason pvid_trust_judge_f32(pvid_trust_f32 *self, pvid_estimator_f32 *estimator, pvid_reason reason, float size,
                                 bool above_noise, float variance_ratio, uint16_t freedom, pvid_estimate_f32 *candidate)
{
    if (reason == PVID_UPDATED) {
        pvid_trust_compare_f32(self, estimator->model->n_p, candidate);
    }
    const pvid_reason verdict =
        pvid_trust_decide_f32(self, estimator, reason, size, above_noise, variance_ratio, candidate);
    const pvid_reason reported = pvid_trust_publish_f32(self, estimator, verdict, reason, candidate);
    pvid_trust_stand_f32(self, verdict, reason, variance_ratio, freedom, false, 0, candidate);
    return reported;
}

uint32_t pvid_fingerprint_trust_f32(uint32_t hash, const pvid_trust_config_f32 *config, size_t n_p)
{
    uint32_t running = pvid_fingerprint_float(hash, config->kappa_min);
    running = pvid_fingerprint_float(running, config->se_max);
    running = pvid_fingerprint_float(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    running = pvid_fnv_word(running, config->age_max);
    running = pvid_fingerprint_float(running, config->renewal);
    return pvid_fingerprint_floats(running, config->shared, (config->shared != NULL) ? ((n_p * (n_p + 1u)) / 2u) : 0u);
}
