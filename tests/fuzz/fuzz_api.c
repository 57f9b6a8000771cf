/* Random calls of the public API with hostile configurations, tables, samples, snapshots and orders of calls.
 *
 *     fuzz_api CALLS SEED
 *
 * To be built with sanitizers, which see what is out of bounds or undefined. What must hold besides: p is finite and
 * within its bounds, an estimate is finite, a reason is one of status.h, what init has once accepted it accepts again,
 * a damaged snapshot is not restored, an object that is not ready does nothing, and garbage of twelve kinds under sound
 * settings is not published. Prints what was done; exit code 0 iff all of it held. */
#include <stdio.h>
#include <stdlib.h>

#include "hostile.h"
#include "pendulum/kapitza_design_f32.h"
#include "pendulum_q31.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_refine.h"
#include "pvid/snapshot_weak_q31.h"

#define LAST_REASON PVID_NOT_READY
#define ROOM ((size_t)PVID_SNAPSHOT_REFINE_F32 + (size_t)PVID_SNAPSHOT_WEAK_Q31)
#define MOST_TOLD 20u

static struct {
    unsigned long calls;
    unsigned long inits;
    unsigned long accepted;
    unsigned long snapshots;
    unsigned long restored;
    unsigned long sound; /* runs of garbage under sound settings */
    unsigned long published;
    unsigned long bad;
    unsigned long reasons[LAST_REASON + 1];
} done;

static void require(bool holds, const char *what)
{
    if (!holds) {
        printf("FAIL %s, call %lu\n", what, done.calls);
        if (++done.bad > MOST_TOLD) {
            exit(1);
        }
    }
}

/* One of the identifiers, with whatever configuration it was last given. */
typedef struct {
    const char *name;
    void (*configure)(bool sound);
    pvid_status (*init)(void);
    pvid_reason (*step)(uint32_t kind, unsigned long tick);
    void (*gap)(void);
    void (*freeze)(bool frozen);
    void (*check)(bool published); /* the state, and what is published or assessed */
    size_t (*save)(uint8_t image[], size_t room);
    pvid_snapshot_status (*restore)(const uint8_t image[], size_t length);
    bool (*has_published)(void);
    void (*clear)(void); /* as before init */
    unsigned long ticks; /* most of a run: what a step costs differs */
} form;

static void check_p_f32(const pvid_estimator_f32 *estimator)
{
    for (size_t i = 0; i < estimator->model->n_p; i++) {
        const float p = estimator->p[i];
        require(isfinite(p) && (p >= estimator->settings.lower[i]) && (p <= estimator->settings.upper[i]),
                "p within its bounds");
    }
}

static void check_estimate_f32(const pvid_estimate_f32 *estimate, size_t n_p)
{
    for (size_t i = 0; i < n_p; i++) {
        require(isfinite(estimate->p[i]) && isfinite(estimate->se[i]), "a finite estimate");
        for (size_t j = 0; j < n_p; j++) {
            require(isfinite(estimate->covariance[i][j]), "a finite covariance");
        }
    }
    require((estimate->kappa >= 0.0f) && (estimate->kappa <= 1.0f), "kappa in 0..1");
    require(isfinite(estimate->residual_sd) && isfinite(estimate->weight), "a finite residual");
}

static void check_p_q31(const pvid_estimator_q31 *estimator)
{
    for (size_t i = 0; i < estimator->model->n_p; i++) {
        require((estimator->p[i] >= estimator->settings.lower[i]) && (estimator->p[i] <= estimator->settings.upper[i]),
                "q31 p within its bounds");
    }
}

static void spoil(float *const fields[], size_t n)
{
    for (uint32_t left = 1u + below(3); left > 0u; left--) {
        *fields[below((uint32_t)n)] = hostile_float();
    }
}

/* A size for which there are tables, or one that init refuses. */
static uint8_t any_size(uint8_t own, uint32_t most)
{
    return (uint8_t)(one_in(4) ? (most + 1u + below(100)) : below((uint32_t)own + 1u));
}

static void spoil_estimator_f32(pvid_estimator_config_f32 *config)
{
    float *const fields[] = {
        &config->start[below(4)], &config->start_sd[below(4)], &config->lower[below(4)], &config->upper[below(4)],
        &config->row_sd,          &config->forgetting_s,       &config->feedback_hz,     &config->correlation,
        &config->row_weight,      &config->step_limit,         &config->kappa_min,       &config->noise_margin,
        &config->dead_zone,       &config->update_rate_hz,
    };
    spoil(fields, sizeof fields / sizeof fields[0]);
    if (one_in(8)) {
        config->law = (pvid_law)below(3);
    }
    if (one_in(8)) {
        config->divider = (uint16_t)any_word();
    }
}

static void spoil_estimator_q31(pvid_estimator_config_q31 *config)
{
    int32_t *const fields[] = {&config->start[below(4)], &config->start_sd[below(4)],
                               &config->lower[below(4)], &config->upper[below(4)],
                               &config->row_sd,          &config->gain,
                               &config->kappa_min};
    uint32_t *const counts[] = {&config->forgetting_groups, &config->correlation,  &config->row_weight,
                                &config->step_limit,        &config->noise_margin, &config->dead_zone};
    for (uint32_t left = 1u + below(3); left > 0u; left--) {
        if (one_in(2)) {
            *fields[below((uint32_t)(sizeof fields / sizeof fields[0]))] = any_size_i32();
        } else {
            *counts[below((uint32_t)(sizeof counts / sizeof counts[0]))] = (uint32_t)any_size_i32();
        }
    }
    if (one_in(6)) {
        config->p_bits[below(4)] = (int8_t)any_i32();
    }
    if (one_in(6)) {
        config->n_bits[below(8)] = (int8_t)any_i32();
    }
    if (one_in(6)) {
        config->y_bits = (int8_t)any_i32();
    }
    if (one_in(6)) {
        config->divider = (uint16_t)any_word();
    }
}

/* ---- weak, float32 ---- */

static struct {
    pvid_weak_f32 self;
    pvid_weak_config_f32 config;
    pvid_weak_design_f32 design;
    float circle[sizeof kapitza_circle / sizeof kapitza_circle[0]];
    float range[KAPITZA_WEAK_SAMPLES];
    float shared[10];
    float variance[KAPITZA_WEAK_KINDS];
    pvid_weak_noise_f32 noise[sizeof kapitza_noise / sizeof kapitza_noise[0]];
} weak;

static void spoil_tables(void)
{
    if (one_in(5)) {
        for (size_t i = 0; i < sizeof weak.circle / sizeof weak.circle[0]; i++) {
            weak.circle[i] = one_in(50) ? hostile_float() : (kapitza_circle[i] * (1.0f + (0.5f * any_part())));
        }
        weak.design.circle = weak.circle;
    }
    if (one_in(5)) {
        for (size_t i = 0; i < sizeof weak.noise / sizeof weak.noise[0]; i++) {
            weak.noise[i] = kapitza_noise[i];
            weak.noise[i].factor = one_in(20) ? hostile_float() : kapitza_noise[i].factor;
            weak.noise[i].a = one_in(100) ? (uint8_t)any_word() : kapitza_noise[i].a;
        }
        weak.design.noise = weak.noise;
    }
    if (one_in(5)) {
        weak.variance[0] = hostile_float();
        weak.design.error_variance = weak.variance;
    }
    if (one_in(5)) {
        weak.range[0] = hostile_float();
        weak.range[1] = hostile_float();
        weak.config.range = weak.range;
    }
    if (one_in(5)) {
        weak.shared[below(10)] = hostile_float();
        weak.config.trust.shared = weak.shared;
    }
}

static void configure_weak(bool sound)
{
    pvid_weak_config_f32 *config = &weak.config;
    weak.design = kapitza_design_f32;
    *config = kapitza_config_f32;
    config->design = &weak.design;
    config->gate.sigmas = one_in(3) ? 4.0f : 0.0f;
    config->gate.patience_s = one_in(2) ? 10.0f : 0.0f;
    config->estimator.forgetting_s = one_in(3) ? 5.0f : 0.0f;
    config->drive_min = one_in(4) ? NULL : config->drive_min;
    config->range = one_in(2) ? NULL : config->range;
    config->trust.shared = one_in(4) ? NULL : config->trust.shared;
    config->compensation = !one_in(4);
    config->estimator.dead_zone = one_in(4) ? 1.0f : 0.0f;
    if (sound) {
        return;
    }
    float *const fields[] = {&config->sample_rate_hz,   &config->trust.kappa_min, &config->trust.se_max,
                             &config->trust.misfit_max, &config->trust.renewal,   &config->gate.sigmas,
                             &config->gate.patience_s,  &weak.design.overlap};
    if (one_in(2)) {
        spoil(fields, sizeof fields / sizeof fields[0]);
    }
    if (one_in(2)) {
        spoil_estimator_f32(&config->estimator);
    }
    spoil_tables();
    weak.design.functions = one_in(8) ? any_size(weak.design.functions, PVID_MAX_FUNCTIONS) : weak.design.functions;
    weak.design.power = one_in(8) ? any_size(weak.design.power, PVID_MAX_POWER) : weak.design.power;
    weak.design.decimation = one_in(8) ? (uint8_t)below(40) : weak.design.decimation;
    weak.design.hop = one_in(8) ? (uint16_t)below((uint32_t)weak.design.hop + 1u) : weak.design.hop;
    weak.design.n_noise = one_in(8) ? (uint16_t)below((uint32_t)weak.design.n_noise + 1u) : weak.design.n_noise;
    config->iterations = one_in(8) ? (uint8_t)any_word() : config->iterations;
    config->trust.groups_min = one_in(8) ? (uint16_t)any_word() : config->trust.groups_min;
    config->trust.revert_after = one_in(8) ? (uint16_t)below(3) : config->trust.revert_after;
    config->trust.age_max = one_in(8) ? (uint16_t)below(3) : config->trust.age_max;
    config->design = one_in(20) ? NULL : config->design;
}

static pvid_status init_weak(void)
{
    return pvid_weak_init_f32(&weak.self, &weak.config);
}

static pvid_reason step_weak(uint32_t kind, unsigned long tick)
{
    float sample[2 * KAPITZA_WEAK_SAMPLES]; /* y, phi */
    hostile_sample(kind, tick, &sample[1], &sample[0]);
    hostile_sample(kind, tick, &sample[3], &sample[2]);
    return one_in(4) ? pvid_weak_step_block_f32(&weak.self, sample, 2) : pvid_weak_step_f32(&weak.self, sample);
}

static void gap_weak(void)
{
    pvid_weak_gap_f32(&weak.self);
    for (uint8_t i = 0; i < PVID_MAX_CHANNELS; i++) {
        (void)pvid_weak_rebase_f32(&weak.self, 1u, i, 0.5f);
    }
}

static void freeze_weak(bool frozen)
{
    pvid_weak_freeze_f32(&weak.self, frozen);
}

static uint8_t record[PVID_RECORD_BYTES(PVID_MAX_P)];

/* What is published and valid is the start of another life, with the errors that it has; nothing else is. */
static void check_record_f32(const pvid_estimate_f32 *estimate, uint32_t number)
{
    static pvid_weak_f32 next;
    pvid_record_writer writer = {0, 0, 0};
    const uint32_t n_p = weak.self.estimator.model->n_p;
    pvid_record_status status = PVID_RECORD_MORE;
    for (uint32_t left = n_p; (left > 0u) && (status == PVID_RECORD_MORE); left--) {
        status = pvid_record_save_weak_f32(&weak.self, &writer, 1u, record, sizeof record);
    }
    const bool valid = (number > 0u) && (estimate->standing.state == (uint8_t)PVID_STANDING_VALID);
    require(status == (valid ? PVID_RECORD_DONE : PVID_RECORD_NOT_VALID), "a record is of a valid estimate");
    bool sound = valid;
    for (uint32_t a = 0; a < n_p; a++) {
        sound = sound && (estimate->se[a] > 1.0e-17f) && (estimate->se[a] < 1.0e17f);
    }
    pvid_weak_config_f32 alone = weak.config;
    alone.refine = NULL;
    if (sound && (pvid_weak_init_f32(&next, &alone) == PVID_OK)) {
        require(pvid_record_load_weak_f32(&next, &alone, 1u, record, sizeof record) == PVID_RECORD_DONE,
                "a record is taken");
        const pvid_estimate_f32 *start = pvid_weak_estimate_f32(&next);
        check_estimate_f32(start, n_p);
        require(memcmp(start->se, estimate->se, n_p * sizeof start->se[0]) == 0, "a record has its errors");
    }
}

static void check_weak(bool published)
{
    check_p_f32(&weak.self.estimator);
    if (!published) {
        return;
    }
    pvid_estimate_f32 copy;
    uint32_t number;
    const pvid_estimate_f32 *estimate = pvid_weak_estimate_f32(&weak.self);
    check_estimate_f32(estimate, weak.self.estimator.model->n_p);
    require(pvid_weak_read_f32(&weak.self, &copy, &number) && ((number > 0u) == weak.self.trust.published) &&
                (memcmp(&copy, estimate, sizeof copy) == 0),
            "a read estimate is the published one");
    check_record_f32(&copy, number);
    pvid_estimator_assess_f32(&weak.self.estimator, &copy);
    check_estimate_f32(&copy, weak.self.estimator.model->n_p);
}

static size_t save_weak(uint8_t image[], size_t room)
{
    return pvid_snapshot_save_weak_f32(&weak.self, &weak.config, any_word(), image, room);
}

static pvid_snapshot_status restore_weak(const uint8_t image[], size_t length)
{
    return pvid_snapshot_restore_weak_f32(&weak.self, &weak.config, image, length);
}

static bool weak_has_published(void)
{
    return weak.self.trust.published;
}

static void clear_weak(void)
{
    memset(&weak.self, 0, sizeof weak.self);
}

/* ---- weak with its refinement, float32 ---- */

static struct {
    pvid_refine_f32 self;
    pvid_refine_config_f32 config;
    pvid_weak_refine_f32 second;
    pvid_refine_signal_f32 signal[PVID_REFINE_SIGNALS];
    float second_weights[PVID_REFINE_HALF + 1];
} refined;

static void spoil_refinement(pvid_refine_config_f32 *config)
{
    float *const fields[] = {&config->sample_rate_hz,
                             &config->sd[0],
                             &config->prior_sd[below(PVID_REFINE_PARAMETERS)],
                             &config->state_limit[below(PVID_REFINE_STATES)],
                             &config->forgetting_s,
                             &config->outlier_gate,
                             &config->gate,
                             &config->chi_max,
                             &config->clash_max,
                             &config->step_max,
                             &config->step_limit,
                             &config->se_max,
                             &config->distance,
                             &refined.signal[below(PVID_REFINE_SIGNALS)].scale,
                             &refined.signal[below(PVID_REFINE_SIGNALS)].range,
                             &refined.second_weights[below(PVID_REFINE_HALF + 1)]};
    if (one_in(2)) {
        spoil(fields, sizeof fields / sizeof fields[0]);
    }
    config->ratio = one_in(4) ? (uint8_t)below(12) : config->ratio;
    config->block = one_in(8) ? (uint16_t)below(100) : config->block;
    config->first_block = one_in(8) ? (uint16_t)below(100) : config->first_block;
    config->passes = one_in(8) ? (uint8_t)below(18) : config->passes;
    config->most_passes = one_in(8) ? (uint8_t)below(18) : config->most_passes;
    config->jobs = one_in(8) ? (uint8_t)below(132) : config->jobs;
    config->rests = one_in(4) ? (uint8_t)any_word() : config->rests;
    config->second = one_in(16) ? NULL : config->second;
    refined.signal[0].order = one_in(16) ? (int8_t)((int32_t)below(5) - 2) : refined.signal[0].order;
    refined.signal[1].sample = one_in(16) ? (uint8_t)below(KAPITZA_WEAK_SAMPLES + 1u) : refined.signal[1].sample;
    refined.signal[0].source = one_in(8) ? (uint8_t)below(3) : refined.signal[0].source;
}

static void configure_refined(bool sound)
{
    static const pvid_refine_signal_f32 signals[PVID_REFINE_SIGNALS] = {
        {0, 2, PVID_SIGNAL_SAMPLED, 1.0f / 0.3f, 100.0f}, {1, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const float six_steps[PVID_REFINE_HALF + 1] = {-868.0f, [6] = 434.0f};
    static const pvid_refine_config_f32 fresh = {
        .sample_rate_hz = 1000.0f,
        .ratio = 8,
        .second = refined.second_weights,
        .signal = refined.signal,
        .block = 84,
        .first_block = 22,
        .passes = 2,
        .most_passes = 8,
        .jobs = 3,
        .rests = 1,
        .sd = {4.0e-5f},
        .prior_sd = {0.15f, 0.15f, 0.15f, 0.1f, 0.05f, 0.005f, 0.1f},
        .state_limit = {3.5f, 3.5f, 60.0f, 60.0f},
        .outlier_gate = 4.0f,
        .gate = 8.0f,
        .chi_max = 3.0f,
        .clash_max = 25.0f,
        .step_max = 0.02f,
        .step_limit = 2.0f,
        .se_max = 0.01f,
        .distance = 0.03f,
    };
    configure_weak(sound || one_in(2));
    memcpy(refined.signal, signals, sizeof signals);
    memcpy(refined.second_weights, six_steps, sizeof six_steps);
    refined.config = fresh;
    refined.config.forgetting_s = one_in(3) ? 5.0f : 0.0f;
    refined.config.outlier_gate = one_in(4) ? 0.0f : 4.0f;
    if (!sound) {
        spoil_refinement(&refined.config);
    }
    refined.second = (pvid_weak_refine_f32){&pvid_refiner_f32, &refined.self, &refined.config};
    weak.config.refine = &refined.second;
}

static void check_refined(bool published)
{
    pvid_estimate_f32 best;
    pvid_refine_estimate_f32 copy;
    uint32_t number;
    check_weak(published);
    const pvid_refine_estimate_f32 *estimate = pvid_refine_latest_f32(&refined.self);
    if ((estimate == NULL) || !one_in(20)) {
        return;
    }
    for (size_t i = 0; i < PVID_REFINE_PARAMETERS; i++) {
        require(isfinite(estimate->r[i]) && isfinite(estimate->se[i]) && (estimate->se[i] >= 0.0f),
                "a finite refined estimate");
        for (size_t j = 0; j < PVID_REFINE_PARAMETERS; j++) {
            require(isfinite(estimate->covariance[i][j]), "a finite refined covariance");
        }
    }
    require(isfinite(estimate->level) && isfinite(estimate->clash), "a finite level");
    require(pvid_refine_read_f32(&refined.self, &copy, &number) && (number > 0u) &&
                (memcmp(&copy, estimate, sizeof copy) == 0),
            "a read refined estimate is the published one");
    require((pvid_refine_best_f32(&refined.self, pvid_weak_estimate_f32(&weak.self), &best) == PVID_STAGE_REFINED) &&
                isfinite(best.p[0]) && isfinite(best.se[0]),
            "the refined estimate is the best one while it stands");
}

static size_t save_refined(uint8_t image[], size_t room)
{
    return pvid_snapshot_save_refine_f32(&weak.self, &weak.config, any_word(), image, room);
}

static pvid_snapshot_status restore_refined(const uint8_t image[], size_t length)
{
    return pvid_snapshot_restore_refine_f32(&weak.self, &weak.config, image, length);
}

static bool refined_has_published(void)
{
    return refined.self.published > 0u;
}

/* ---- weak, integers ---- */

#define PENDULUM_TERMS 13
#define PENDULUM_NOISE 21

static struct {
    pvid_weak_q31 self;
    pvid_weak_config_q31 config;
    pvid_weak_design_q31 design;
    int32_t full_scale[KAPITZA_WEAK_SAMPLES];
    int32_t offset[KAPITZA_WEAK_SAMPLES];
    int32_t drive_min[KAPITZA_WEAK_SAMPLES];
    int32_t shared[10];
    pvid_scaled_q31 factor[PENDULUM_TERMS];
    pvid_weak_noise_q31 noise[PENDULUM_NOISE];
} weak_q31;

static void spoil_tables_q31(void)
{
    const pvid_weak_design_q31 *sound = pendulum_config_q31->design;
    if (one_in(5)) {
        const size_t i = below(PENDULUM_TERMS);
        memcpy(weak_q31.factor, sound->factor, sizeof weak_q31.factor);
        weak_q31.factor[i].m = one_in(2) ? any_size_i32() : sound->factor[i].m;
        weak_q31.factor[i].e = one_in(2) ? any_size_i32() : sound->factor[i].e;
        weak_q31.design.factor = weak_q31.factor;
    }
    if (one_in(5)) {
        const size_t i = below(PENDULUM_NOISE);
        memcpy(weak_q31.noise, sound->noise, sizeof weak_q31.noise);
        weak_q31.noise[i].factor.m = one_in(2) ? any_size_i32() : sound->noise[i].factor.m;
        weak_q31.noise[i].a = one_in(4) ? (uint8_t)any_word() : sound->noise[i].a;
        weak_q31.design.noise = weak_q31.noise;
    }
    if (one_in(5)) { /* the formats are those of the sound one: a smaller one is within them */
        for (size_t i = 0; i < KAPITZA_WEAK_SAMPLES; i++) {
            weak_q31.full_scale[i] = one_in(4) ? -any_i32() / 2 : 1 + (int32_t)below((uint32_t)sound->full_scale[i]);
            weak_q31.full_scale[i] = (weak_q31.full_scale[i] > sound->full_scale[i]) ? 0 : weak_q31.full_scale[i];
        }
        weak_q31.design.full_scale = weak_q31.full_scale;
    }
}

static void configure_weak_q31(bool sound)
{
    pvid_weak_config_q31 *config = &weak_q31.config;
    *config = *pendulum_config_q31;
    weak_q31.design = *config->design;
    config->design = &weak_q31.design;
    config->estimator.forgetting_groups = one_in(3) ? 8u : 0u;
    config->gate.sigmas = one_in(3) ? 0u : config->gate.sigmas;
    config->drive_min = one_in(3) ? NULL : config->drive_min;
    config->compensation = !one_in(4);
    if (sound) {
        return;
    }
    if (one_in(2)) {
        spoil_estimator_q31(&config->estimator);
    }
    for (size_t i = 0; i < KAPITZA_WEAK_SAMPLES; i++) {
        weak_q31.offset[i] = one_in(3) ? any_i32() : 0;
        weak_q31.drive_min[i] = one_in(3) ? any_size_i32() : 0;
    }
    config->offset = one_in(6) ? weak_q31.offset : config->offset;
    config->drive_min = one_in(6) ? weak_q31.drive_min : config->drive_min;
    config->iterations = one_in(6) ? (uint8_t)any_word() : config->iterations;
    config->trust.kappa_min = one_in(6) ? any_i32() : config->trust.kappa_min;
    config->trust.se_max = one_in(6) ? any_size_i32() : config->trust.se_max;
    config->trust.misfit_max = one_in(6) ? (uint32_t)any_size_i32() : config->trust.misfit_max;
    config->trust.renewal = one_in(6) ? (uint32_t)any_size_i32() : config->trust.renewal;
    weak_q31.shared[below(10)] = any_size_i32();
    config->trust.shared = one_in(4) ? weak_q31.shared : config->trust.shared;
    spoil_tables_q31();
    pvid_weak_design_q31 *design = &weak_q31.design;
    design->functions = one_in(8) ? any_size(design->functions, PVID_MAX_FUNCTIONS) : design->functions;
    design->power = one_in(8) ? any_size(design->power, PVID_MAX_POWER) : design->power;
    design->decimation = one_in(8) ? (uint8_t)below((uint32_t)design->decimation + 1u) : design->decimation;
    design->hop = one_in(8) ? (uint16_t)below((uint32_t)design->hop + 1u) : design->hop;
    design->n_noise = one_in(8) ? (uint16_t)below((uint32_t)design->n_noise + 1u) : design->n_noise;
    design->circle = one_in(20) ? NULL : design->circle;
    config->design = one_in(20) ? NULL : config->design;
}

static pvid_status init_weak_q31(void)
{
    return pvid_weak_init_q31(&weak_q31.self, &weak_q31.config);
}

static pvid_reason step_weak_q31(uint32_t kind, unsigned long tick)
{
    static const double lsb[2] = {3.835e-4, 5.0e-6};
    static const int32_t full_scale[2] = {782, 6000};
    int32_t reading[2 * KAPITZA_WEAK_SAMPLES]; /* y, phi */
    hostile_counts(kind, tick, lsb, full_scale, &reading[1], &reading[0]);
    hostile_counts(kind, tick, lsb, full_scale, &reading[3], &reading[2]);
    return one_in(4) ? pvid_weak_step_block_q31(&weak_q31.self, reading, 2)
                     : pvid_weak_step_q31(&weak_q31.self, reading);
}

static void gap_weak_q31(void)
{
    pvid_weak_gap_q31(&weak_q31.self);
}

static void freeze_weak_q31(bool frozen)
{
    pvid_weak_freeze_q31(&weak_q31.self, frozen);
}

static void check_record_q31(const pvid_estimate_q31 *estimate, uint32_t number)
{
    static pvid_weak_q31 next;
    pvid_record_writer writer = {0, 0, 0};
    const uint32_t n_p = weak_q31.self.estimator.model->n_p;
    pvid_record_status status = PVID_RECORD_MORE;
    for (uint32_t left = n_p; (left > 0u) && (status == PVID_RECORD_MORE); left--) {
        status = pvid_record_save_weak_q31(&weak_q31.self, &writer, 1u, record, sizeof record);
    }
    const bool valid = (number > 0u) && (estimate->standing.state == (uint8_t)PVID_STANDING_VALID);
    require(status == (valid ? PVID_RECORD_DONE : PVID_RECORD_NOT_VALID), "a q31 record is of a valid estimate");
    if (valid && (pvid_weak_init_q31(&next, &weak_q31.config) == PVID_OK)) {
        status = pvid_record_load_weak_q31(&next, &weak_q31.config, 1u, record, sizeof record);
        require((status == PVID_RECORD_DONE) || (status == PVID_RECORD_IMPLAUSIBLE), "a q31 record is read");
        check_p_q31(&next.estimator);
    }
}

static void check_weak_q31(bool published)
{
    check_p_q31(&weak_q31.self.estimator);
    pvid_estimate_q31 copy;
    uint32_t number;
    if (published) {
        require(pvid_weak_read_q31(&weak_q31.self, &copy, &number) &&
                    ((number > 0u) == weak_q31.self.trust.published) &&
                    (memcmp(&copy, pvid_weak_estimate_q31(&weak_q31.self), sizeof copy) == 0),
                "a read q31 estimate is the published one");
        check_record_q31(&copy, number);
        pvid_estimator_assess_q31(&weak_q31.self.estimator, &copy);
    }
}

static size_t save_weak_q31(uint8_t image[], size_t room)
{
    return pvid_snapshot_save_weak_q31(&weak_q31.self, &weak_q31.config, any_word(), image, room);
}

static pvid_snapshot_status restore_weak_q31(const uint8_t image[], size_t length)
{
    return pvid_snapshot_restore_weak_q31(&weak_q31.self, &weak_q31.config, image, length);
}

static bool weak_q31_has_published(void)
{
    return weak_q31.self.trust.published;
}

static void clear_weak_q31(void)
{
    memset(&weak_q31.self, 0, sizeof weak_q31.self);
}

static const form forms[] = {
    {"weak f32", configure_weak, init_weak, step_weak, gap_weak, freeze_weak, check_weak, save_weak, restore_weak,
     weak_has_published, clear_weak, 12000},
    {"refined f32", configure_refined, init_weak, step_weak, gap_weak, freeze_weak, check_refined, save_refined,
     restore_refined, refined_has_published, clear_weak, 12000},
    {"weak q31", configure_weak_q31, init_weak_q31, step_weak_q31, gap_weak_q31, freeze_weak_q31, check_weak_q31,
     save_weak_q31, restore_weak_q31, weak_q31_has_published, clear_weak_q31, 12000},
};

/* ---- the calls ---- */

static uint8_t image[ROOM];
static size_t saved;

static void restore(const form *one, size_t length, bool expected)
{
    done.snapshots++;
    const bool restored = one->restore(image, length) == PVID_SNAPSHOT_RESTORED;
    done.restored += restored ? 1u : 0u;
    require(restored == expected, "a snapshot is restored iff it is whole");
}

/* One of the things that seldom happen between two ticks. */
static void disturb(const form *one, uint32_t *kind)
{
    switch (below(9)) {
    case 0:
        one->gap();
        break;
    case 1:
        one->freeze(one_in(2));
        break;
    case 2:
        require(one->init() == PVID_OK, "what was accepted is accepted again");
        break;
    case 3:
        saved = one->save(image, sizeof image);
        require((saved > 0u) && (one->save(image, saved - 1u) == 0u), "a snapshot fits where it fits");
        break;
    case 4:
        if (saved > 0u) {
            restore(one, saved, true);
        }
        break;
    case 5:
        if (saved > 0u) {
            image[below((uint32_t)saved)] ^= (uint8_t)(1u << below(8));
            restore(one, saved, false);
            saved = 0;
        }
        break;
    case 6:
        for (size_t i = 0; i < sizeof image; i++) {
            image[i] = (uint8_t)any_word();
        }
        restore(one, below((uint32_t)sizeof image + 1u), false);
        (void)pvid_snapshot_choose(image, image, below((uint32_t)sizeof image));
        saved = 0;
        break;
    default:
        *kind = below(HOSTILE_SIGNALS);
        break;
    }
}

static void call_before_init(const form *one, uint32_t kind)
{
    for (unsigned long tick = 0; tick < 20u; tick++) {
        done.calls++;
        require(one->step(kind, tick) == PVID_NOT_READY, "an object that is not ready says so");
    }
    one->gap();
    one->freeze(true);
    require(one->save(image, sizeof image) == 0u, "no snapshot before init");
    require(one->restore(image, sizeof image) == PVID_SNAPSHOT_NOT_READY, "nothing is restored before init");
}

static void play(const form *one)
{
    const bool sound = one_in(2);
    uint32_t kind = below(HOSTILE_SIGNALS);
    saved = 0;
    one->configure(sound);
    if (one_in(10)) {
        one->clear();
        call_before_init(one, kind);
    }
    done.inits++;
    const pvid_status status = one->init();
    require(!sound || (status == PVID_OK), "sound settings are accepted");
    if (status != PVID_OK) {
        call_before_init(one, kind);
        return;
    }
    done.accepted++;
    const unsigned long ticks = 100u + below((uint32_t)one->ticks / (one_in(4) ? 1u : 20u));
    for (unsigned long tick = 0; tick < ticks; tick++) {
        done.calls++;
        const pvid_reason reason = one->step(kind, tick);
        require((unsigned int)reason < (unsigned int)LAST_REASON, "a reason of status.h");
        done.reasons[((unsigned int)reason <= (unsigned int)LAST_REASON) ? reason : LAST_REASON]++;
        one->check((reason == PVID_UPDATED) || (reason == PVID_MISFIT));
        if (one_in(400)) {
            disturb(one, &kind);
        }
    }
    if (sound) {
        done.sound++;
        done.published += one->has_published() ? 1u : 0u;
    }
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: fuzz_api CALLS SEED\n");
        return 2;
    }
    const unsigned long wanted = strtoul(argv[1], NULL, 10);
    hostile_seed(strtoull(argv[2], NULL, 10));
    while (done.calls < wanted) {
        play(&forms[below((uint32_t)(sizeof forms / sizeof forms[0]))]);
    }
    require(done.published == 0u, "garbage under sound settings is not published");
    printf("calls %lu inits %lu accepted %lu snapshots %lu restored %lu sound %lu published %lu failed %lu\nreasons",
           done.calls, done.inits, done.accepted, done.snapshots, done.restored, done.sound, done.published, done.bad);
    for (size_t i = 0; i <= (size_t)LAST_REASON; i++) {
        printf(" %lu", done.reasons[i]);
    }
    printf("\n");
    return (done.bad == 0u) ? 0 : 1;
}
