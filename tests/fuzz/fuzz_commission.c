/* Commissionings of random limits, tables, samples and orders of calls.
 *
 *     fuzz_commission CALLS SEED
 *
 * To be built with sanitizers. What must hold besides: sound settings are accepted, an object that is not ready does
 * nothing; a drive is within its limits, changes by no more than its slew rate in a tick and is 0 outside bursts; the
 * states follow one another; at the end there is a verdict, and values that are done are finite. Prints what was
 * reached; exit code 0 iff all of it held. */
#include <stdio.h>
#include <stdlib.h>

#include "hostile.h"
#include "pendulum/kapitza_design_f32.h"
#include "pvid/commission.h"

#define SAMPLES 2u
#define DRIVES 2u
#define RING 4096u
#define LAST_VERDICT PVID_COMMISSION_TOO_SLOW

static struct {
    unsigned long calls;
    unsigned long accepted;
    unsigned long bad;
    unsigned long verdicts[LAST_VERDICT + 1];
} done;

static pvid_excite_part_f32 part[DRIVES][PVID_EXCITE_PARTS];
static pvid_excite_guard_f32 guard[DRIVES][PVID_EXCITE_GUARDS];
static pvid_excite_config_f32 excite[DRIVES];
static pvid_excite_f32 excitation[DRIVES];
static uint8_t input[DRIVES];
static float ring[RING * SAMPLES];
static float level[3];
static pvid_weak_f32 identifier;
static pvid_weak_config_f32 weak;
static pvid_commission_config_f32 config;
static pvid_commission_f32 self;

static void require(bool holds, const char *what)
{
    if (!holds) {
        printf("FAIL %s, call %lu\n", what, done.calls);
        if (++done.bad > 20u) {
            exit(1);
        }
    }
}

static float between(float low, float high)
{
    return low + (any_part() * (high - low));
}

static void fill_part(pvid_excite_part_f32 *one, float high, float rate)
{
    one->kind = (pvid_excite_kind)below(4u);
    one->amplitude = high * any_part();
    one->hz = rate * between(1.0e-3f, 0.4f);
    one->turns = any_part();
    one->to_hz = one->hz + (between(0.0f, 0.09f) * rate);
    one->sweep_s = between(1.0f, 500.0f) / rate;
    one->level = level;
    one->levels = 3u;
}

static void fill_guard(pvid_excite_guard_f32 *one)
{
    const float wide = powf(10.0f, between(-3.0f, 2.0f));
    one->signal = (uint8_t)below(SAMPLES);
    one->of_rate = one_in(2);
    one->low = -wide;
    one->soft_low = -wide * between(0.1f, 0.9f);
    one->soft_high = wide * between(0.1f, 0.9f);
    one->high = wide;
    one->response = (float)below(3u) - 1.0f;
    one->push = ((one->response > 0.5f) || (one->response < -0.5f)) ? any_part() : 0.0f;
    one->ahead_s = one->of_rate ? 0.0f : any_part();
    one->brake = (one->of_rate || one_in(2)) ? 0.0f : powf(10.0f, between(-3.0f, 6.0f));
    one->smoothing_s = any_part() * 0.1f;
}

/* A field of those that are numbers. */
static void spoil(void)
{
    float *const fields[] = {&config.check_scale,       &config.agree,        &config.misfit_max,
                             &config.restrained_max,    &excite[0].low,       &excite[0].high,
                             &excite[0].slew,           &excite[0].ramp_s,    &excite[0].burst_s,
                             &excite[0].sample_rate_hz, &part[0][0].hz,       &part[0][0].amplitude,
                             &guard[0][0].high,         &guard[0][0].ahead_s, &guard[0][0].push,
                             &weak.trust.se_max};
    *fields[below((uint32_t)(sizeof fields / sizeof fields[0]))] = hostile_float();
    if (one_in(3)) {
        uint8_t *const counts[] = {&config.drives,    &config.passes,      &excite[0].parts,
                                   &excite[0].guards, &excite[0].measured, &input[0]};
        const uint32_t which = below((uint32_t)(sizeof counts / sizeof counts[0]));
        *counts[which] = (uint8_t)((which == 0u) ? below(DRIVES + 1u) : any_word()); /* beyond its tables: misuse */
    }
    if (one_in(4)) {
        config.burst_ticks = any_word() >> below(32u);
    }
}

static void configure(bool sound)
{
    weak = kapitza_config_f32;
    const float rate = weak.sample_rate_hz;
    const float ramp_s = (float)(1u + below(100u)) / rate;
    memset(&config, 0, sizeof config);
    config.weak = &weak;
    config.identifier = &identifier;
    config.excite = excite;
    config.excitation = excitation;
    config.input = input;
    config.drives = (uint8_t)below(DRIVES + 1u);
    config.passes = (uint8_t)(1u + below(3u));
    config.burst_ticks = 2u + below(2000u);
    config.ring = ring;
    config.ring_ticks =
        (config.passes > 1u) ? (config.burst_ticks + below(RING - config.burst_ticks)) : (2u + below(RING - 2u));
    config.check_scale = between(0.2f, 1.0f);
    config.agree = between(3.0f, 100.0f);
    config.misfit_max = between(1.0f, 100.0f);
    config.restrained_max = any_part();
    for (size_t i = 0; i < DRIVES; i++) {
        pvid_excite_config_f32 *one = &excite[i];
        const float high = powf(10.0f, between(-3.0f, 3.0f));
        one->sample_rate_hz = rate;
        one->low = -high * any_part();
        one->high = high;
        one->slew = high * rate * powf(10.0f, between(-3.0f, 1.0f));
        one->ramp_s = ramp_s;
        one->burst_s = (float)(config.burst_ticks + below(50u)) / rate;
        one->part = part[i];
        one->guard = guard[i];
        one->parts = (uint8_t)(1u + below(PVID_EXCITE_PARTS));
        one->guards = (uint8_t)below(PVID_EXCITE_GUARDS + 1u);
        one->measured = SAMPLES;
        for (size_t k = 0; k < PVID_EXCITE_PARTS; k++) {
            fill_part(&part[i][k], high, rate);
        }
        for (size_t k = 0; k < PVID_EXCITE_GUARDS; k++) {
            fill_guard(&guard[i][k]);
        }
        input[i] = one_in(3) ? PVID_COMMISSION_NOWHERE : (uint8_t)i;
    }
    for (size_t k = 0; k < 3u; k++) {
        level[k] = between(-1.0f, 1.0f);
    }
    if (!sound) {
        spoil();
    }
}

static void check_drives(const float drive[], float before[], pvid_commission_state was, pvid_commission_state is)
{
    const bool bursts = (was == PVID_COMMISSION_BURST) || (was == PVID_COMMISSION_CHECK);
    for (size_t i = 0; i < config.drives; i++) {
        const pvid_excite_config_f32 *one = &excite[i];
        const float most = (one->slew / one->sample_rate_hz) + (1.0e-6f * (one->high - one->low));
        require((drive[i] >= one->low) && (drive[i] <= one->high), "a drive within its limits");
        require(fabsf(drive[i] - before[i]) <= most, "a drive within its slew rate");
        require(bursts || (drive[i] == 0.0f), "a drive of 0 outside bursts");
        before[i] = drive[i];
    }
    require(is >= was, "states in their order");
}

static void check_end(void)
{
    const pvid_commission_result_f32 *result = pvid_commission_result_of_f32(&self);
    const pvid_commission_verdict verdict = result->verdict;
    require((verdict > PVID_COMMISSION_PENDING) && (verdict <= LAST_VERDICT), "a verdict at the end");
    done.verdicts[(verdict <= LAST_VERDICT) ? verdict : PVID_COMMISSION_PENDING]++;
    for (size_t k = 0; (verdict == PVID_COMMISSION_DONE) && (k < weak.design->model->model->n_p); k++) {
        require(isfinite(result->value[k]) && isfinite(result->check[k]), "values that are finite");
        require(isfinite(result->error[k]) && (result->error[k] >= 0.0f), "errors that are finite");
    }
}

static void play(void)
{
    const bool sound = one_in(2);
    uint32_t kind = below(HOSTILE_SIGNALS);
    float drive[DRIVES] = {0.0f, 0.0f};
    float before[DRIVES] = {0.0f, 0.0f};
    configure(sound);
    const pvid_status status = pvid_commission_init_f32(&self, &config);
    require(!sound || (status == PVID_OK), "sound settings are accepted");
    const bool begins = pvid_commission_start_f32(&self);
    require(begins == (status == PVID_OK), "what is ready begins");
    done.accepted += begins ? 1u : 0u;
    const uint32_t works = one_in(8) ? below(2u) : (4u + below(20u)); /* a tick; fewer: the ring may be full */
    pvid_commission_state was = begins ? PVID_COMMISSION_BURST : PVID_COMMISSION_IDLE;
    for (unsigned long tick = 0; (tick < 20000u) && (was != PVID_COMMISSION_ENDED); tick++) {
        done.calls++;
        float sample[SAMPLES];
        hostile_sample(kind, tick, &sample[0], &sample[1]);
        const pvid_commission_state is = pvid_commission_step_f32(&self, one_in(5000) ? NULL : sample, drive);
        if (begins) {
            check_drives(drive, before, was, is);
        }
        for (uint32_t k = 0u; k < works; k++) {
            const bool more = pvid_commission_work_f32(&self);
            require(begins || !more, "an object that is not ready has no work");
        }
        if (one_in(4000)) {
            pvid_commission_abort_f32(&self);
        }
        kind = one_in(2000) ? below(HOSTILE_SIGNALS) : kind;
        was = pvid_commission_state_of_f32(&self);
        require(begins || (was == PVID_COMMISSION_IDLE), "an object that is not ready does nothing");
        if (!begins && (tick > 20u)) {
            return;
        }
    }
    if (was == PVID_COMMISSION_ENDED) {
        check_end();
    }
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: fuzz_commission CALLS SEED\n");
        return 2;
    }
    const unsigned long wanted = strtoul(argv[1], NULL, 10);
    hostile_seed(strtoull(argv[2], NULL, 10));
    while (done.calls < wanted) {
        play();
    }
    printf("calls %lu accepted %lu failed %lu\nverdicts", done.calls, done.accepted, done.bad);
    for (size_t i = 0; i <= (size_t)LAST_VERDICT; i++) {
        printf(" %lu", done.verdicts[i]);
    }
    printf("\n");
    return (done.bad == 0u) ? 0 : 1;
}
