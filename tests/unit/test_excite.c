/* The excitation: what it sums, its limits on 10 000 random tables, limits and mechanisms, soft start and stop, aborts,
 * and what init refuses. */
#include "test.h"

#include <stdlib.h>

#include "pvid/excite.h"

#define DRAWS ((int)(10000u / ONE_IN))
#define PI 3.14159265358979323846

static pvid_excite_f32 self;

static const pvid_excite_part_f32 sine = {PVID_EXCITE_TONE, 2.0f, 3.0f, 0.25f, 0.0f, 0.0f, NULL, 0u};

static pvid_excite_config_f32 plain(const pvid_excite_part_f32 *part)
{
    const pvid_excite_config_f32 config = {.sample_rate_hz = 1000.0f,
                                           .low = -5.0f,
                                           .high = 5.0f,
                                           .slew = 1.0e6f,
                                           .ramp_s = 0.1f,
                                           .burst_s = 0.5f,
                                           .part = part,
                                           .parts = 1u,
                                           .measured = 2u};
    return config;
}

static void begin(const pvid_excite_config_f32 *config)
{
    assert_int_equal(pvid_excite_init_f32(&self, config), PVID_OK);
    assert_true(pvid_excite_start_f32(&self, 1.0f, 0u));
}

/* ---- random numbers ---- */

static uint32_t generator = 1u;

static uint32_t any(uint32_t below)
{
    generator = (generator * 1664525u) + 1013904223u;
    return (generator >> 8) % below;
}

static float between(double low, double high)
{
    return (float)(low + ((high - low) * ((double)any(1u << 24) / 16777215.0)));
}

/* Evenly in its logarithm. */
static float about(double low, double high)
{
    return (float)(low * pow(high / low, (double)between(0.0, 1.0)));
}

/* ---- parts ---- */

static void a_tone_is_the_sine_of_the_table(void **state)
{
    const pvid_excite_config_f32 config = plain(&sine);
    begin(&config);
    for (int k = 0; k < 600; k++) {
        const double x = (k < 100) ? k / 100.0 : 1.0;
        const double t = k / 1000.0;
        const double expected = x * x * (3.0 - (2.0 * x)) * 2.0 * sin(2.0 * PI * ((3.0 * t) + 0.25));
        assert_true(fabs((double)pvid_excite_step_f32(&self, NULL) - expected) < 1.0e-5);
    }
}

static void a_chirp_turns_at_its_ends(void **state)
{
    const pvid_excite_part_f32 chirp = {PVID_EXCITE_CHIRP, 1.0f, 5.0f, 0.0f, 45.0f, 0.5f, NULL, 0u};
    pvid_excite_config_f32 config = plain(&chirp);
    config.burst_s = 2.0f;
    begin(&config);
    int crossings[4] = {0, 0, 0, 0};
    float last = 0.0f;
    for (int k = 0; k < 2000; k++) {
        const float now = pvid_excite_step_f32(&self, NULL);
        crossings[k / 500] += ((last < 0.0f) && (now >= 0.0f)) ? 1 : 0;
        last = now;
        assert_true((self.wave[0].hz >= 5.0f) && (self.wave[0].hz <= 45.0f));
    }
    for (int leg = 0; leg < 4; leg++) {
        assert_true((crossings[leg] >= 11) && (crossings[leg] <= 14)); /* 25 Hz in the mean, of half a second */
    }
}

static void a_prbs_has_two_levels_and_the_longest_period(void **state)
{
    const pvid_excite_part_f32 prbs = {PVID_EXCITE_PRBS, 1.5f, 500.0f, 0.3f, 0.0f, 0.0f, NULL, 0u};
    pvid_excite_config_f32 config = plain(&prbs);
    config.burst_s = 1000.0f;
    begin(&config);
    int sum = 0;
    const int first = self.wave[0].place;
    for (int k = 0; k < (2 * 65535); k++) {
        const float drive = pvid_excite_step_f32(&self, NULL);
        assert_true((k < 100) || (fabsf(drive) == 1.5f));
        sum += (k < 100) ? 0 : (drive > 0.0f) ? 1 : -1;
        assert_true((k == 0) || (k % 2 == 0) || (self.wave[0].place != first) || (k == ((2 * 65535) - 1)));
    }
    assert_int_equal(self.wave[0].place, first);
    assert_true(abs(sum) <= 110);
}

static void steps_follow_their_levels(void **state)
{
    static const float level[3] = {1.0f, -0.5f, 0.0f};
    const pvid_excite_part_f32 steps = {PVID_EXCITE_STEPS, 2.0f, 10.0f, 0.0f, 0.0f, 0.0f, level, 3u};
    const pvid_excite_config_f32 config = plain(&steps);
    begin(&config);
    for (int k = 0; k < 600; k++) {
        const float drive = pvid_excite_step_f32(&self, NULL);
        if ((k >= 100) && ((k % 100) > 1)) { /* 0.1 s of 2^32/1000 a tick is a tick late at most */
            assert_true(drive == (2.0f * level[(k / 100) % 3]));
        }
    }
}

static void another_run_is_another_motion(void **state)
{
    const pvid_excite_config_f32 config = plain(&sine);
    float first[300];
    begin(&config);
    for (int k = 0; k < 300; k++) {
        first[k] = pvid_excite_step_f32(&self, NULL);
    }
    assert_int_equal(pvid_excite_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_excite_start_f32(&self, 0.5f, 1u));
    int equal = 0;
    for (int k = 0; k < 300; k++) {
        const float drive = pvid_excite_step_f32(&self, NULL);
        assert_true(fabsf(drive) <= 1.0f);
        equal += (fabsf(drive - (0.5f * first[k])) < 0.01f) ? 1 : 0;
    }
    assert_true(equal < 30);
}

/* ---- its course ---- */

static void it_starts_softly_and_ends_at_zero(void **state)
{
    const pvid_excite_config_f32 config = plain(&sine);
    assert_int_equal(pvid_excite_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_excite_step_f32(&self, NULL) == 0.0f);
    assert_int_equal(pvid_excite_state_of_f32(&self), PVID_EXCITE_IDLE);
    assert_true(pvid_excite_start_f32(&self, 1.0f, 0u));
    assert_false(pvid_excite_start_f32(&self, 1.0f, 0u));
    int ticks[5] = {0, 0, 0, 0, 0};
    float last = 0.0f;
    for (int k = 0; k < 2000; k++) {
        ticks[pvid_excite_state_of_f32(&self)]++;
        const float drive = pvid_excite_step_f32(&self, NULL);
        assert_true(fabsf(drive - last) < 0.08f); /* 2 pi 3 Hz 2 / 1 kHz, and the envelope's 2 * 1.5 / 100 */
        last = drive;
    }
    assert_int_equal(ticks[PVID_EXCITE_RISING], 100);
    assert_int_equal(ticks[PVID_EXCITE_RUNNING], 500);
    assert_true((ticks[PVID_EXCITE_FALLING] >= 200) && (ticks[PVID_EXCITE_FALLING] <= 202));
    assert_int_equal(pvid_excite_state_of_f32(&self), PVID_EXCITE_ENDED);
    assert_int_equal(pvid_excite_reason_of_f32(&self, NULL), PVID_EXCITE_FINISHED);
    assert_true((last == 0.0f) && (pvid_excite_restrained_f32(&self) == 0.0f));
    assert_true(pvid_excite_start_f32(&self, 1.0f, 1u));
}

static void a_stop_is_soft_and_an_abort_falls_at_the_slew_rate(void **state)
{
    pvid_excite_config_f32 config = plain(&sine);
    config.slew = 100.0f;
    for (int aborts = 0; aborts < 2; aborts++) {
        begin(&config);
        for (int k = 0; k < 300; k++) {
            (void)pvid_excite_step_f32(&self, NULL);
        }
        const float before = self.drive;
        assert_true(fabsf(before) > 0.3f);
        (aborts != 0) ? pvid_excite_abort_f32(&self) : pvid_excite_stop_f32(&self);
        int ticks = 0;
        while (pvid_excite_state_of_f32(&self) != PVID_EXCITE_ENDED) {
            const float last = self.drive;
            (void)pvid_excite_step_f32(&self, NULL);
            assert_true(fabsf(self.drive - last) <= 0.1001f);
            ticks++;
            assert_true(ticks < 400);
        }
        assert_true((aborts != 0) ? (ticks <= (int)(fabsf(before) / 0.1f) + 2) : (ticks >= 200));
        assert_int_equal(pvid_excite_reason_of_f32(&self, NULL),
                         (aborts != 0) ? PVID_EXCITE_ASKED : PVID_EXCITE_FINISHED);
    }
}

static void a_sensor_that_is_no_number_or_missing_aborts(void **state)
{
    const pvid_excite_guard_f32 guard = {1u, false, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f};
    pvid_excite_config_f32 config = plain(&sine);
    config.guard = &guard;
    config.guards = 1u;
    const float bad[4][2] = {{0.0f, NAN}, {0.0f, INFINITY}, {0.0f, 1.01f}, {NAN, 0.0f}};
    for (int k = 0; k < 5; k++) {
        begin(&config);
        const float good[2] = {0.0f, 0.0f};
        for (int tick = 0; tick < 200; tick++) {
            (void)pvid_excite_step_f32(&self, good);
        }
        const float drive = pvid_excite_step_f32(&self, (k < 4) ? bad[k] : NULL);
        uint8_t at = 9u;
        const pvid_excite_reason reason = pvid_excite_reason_of_f32(&self, &at);
        assert_int_equal(reason, (k == 2)   ? PVID_EXCITE_HARD_LIMIT
                                 : (k == 3) ? PVID_EXCITE_FINISHED
                                            : PVID_EXCITE_SENSOR);
        assert_true((k == 3) || (drive == 0.0f));
        assert_int_equal(at, 0u);
    }
}

/* ---- limits ---- */

typedef struct {
    pvid_excite_part_f32 part[PVID_EXCITE_PARTS];
    pvid_excite_guard_f32 guard[PVID_EXCITE_GUARDS];
    float level[3];
    pvid_excite_config_f32 config;
} drawn;

static void draw(drawn *one)
{
    memset(one, 0, sizeof *one);
    pvid_excite_config_f32 *config = &one->config;
    const float rate = about(200.0, 20000.0);
    config->sample_rate_hz = rate;
    config->high = about(1.0e-3, 1.0e4);
    config->low = -config->high * between(0.0, 1.5);
    config->slew = config->high * rate * about(1.0e-3, 10.0);
    config->ramp_s = about(2.0, 100.0) / rate;
    config->burst_s = about(50.0, 400.0) / rate;
    config->part = one->part;
    config->guard = one->guard;
    config->measured = 2u;
    config->parts = (uint8_t)(1u + any(PVID_EXCITE_PARTS));
    for (size_t i = 0; i < 3u; i++) {
        one->level[i] = between(-1.0, 1.0);
    }
    for (size_t i = 0; i < config->parts; i++) {
        pvid_excite_part_f32 *part = &one->part[i];
        part->kind = (pvid_excite_kind)any(4u);
        part->amplitude = config->high * between(0.0, 2.0);
        part->hz = rate * about(1.0e-4, 0.5);
        part->turns = between(0.0, 1.0);
        part->to_hz = part->hz + ((0.5f * rate - part->hz) * between(0.0, 0.999));
        part->sweep_s = about(1.0, 1.0e4) / rate;
        part->level = one->level;
        part->levels = (uint8_t)(1u + any(3u));
    }
}

/* Neither motion nor garbage in the measurements moves the drive beyond its limits, or faster than its slew rate. */
static void no_draw_leaves_the_limits_of_the_drive(void **state)
{
    for (int k = 0; k < DRAWS; k++) {
        drawn one;
        draw(&one);
        one.config.guards = (uint8_t)any(PVID_EXCITE_GUARDS + 1u);
        for (size_t i = 0; i < one.config.guards; i++) {
            pvid_excite_guard_f32 *guard = &one.guard[i];
            const float width = about(1.0e-3, 1.0e6);
            guard->signal = (uint8_t)any(2u);
            guard->of_rate = any(2u) == 0u;
            guard->low = -width;
            guard->soft_low = -width * between(0.1, 0.9);
            guard->soft_high = width * between(0.1, 0.9);
            guard->high = width;
            guard->response = (float)any(3u) - 1.0f;
            guard->push = (guard->response != 0.0f) ? between(0.0, 1.0) : 0.0f;
            guard->ahead_s = guard->of_rate ? 0.0f : about(1.0e-5, 1.0);
            guard->brake = guard->of_rate ? 0.0f : about(1.0e-3, 1.0e9);
            guard->smoothing_s = about(1.0e-5, 1.0);
        }
        const pvid_status status = pvid_excite_init_f32(&self, &one.config);
        assert_int_equal(status, PVID_OK);
        assert_true(pvid_excite_start_f32(&self, between(0.0, 1.0), any(1000u)));
        const float step = one.config.slew / one.config.sample_rate_hz;
        const uint32_t garbage = any(4u);
        float last = 0.0f;
        for (int tick = 0; (tick < 700) && (pvid_excite_state_of_f32(&self) != PVID_EXCITE_ENDED); tick++) {
            float measured[2] = {between(-1.0, 1.0), between(-1.0, 1.0) * about(1.0e-3, 1.0e3)};
            if ((garbage == 0u) && (any(100u) == 0u)) {
                measured[any(2u)] = (any(2u) == 0u) ? NAN : 3.0e38f;
            }
            const float drive = pvid_excite_step_f32(&self, measured);
            assert_true((drive >= one.config.low) && (drive <= one.config.high));
            assert_true((drive <= (last + step)) && (drive >= (last - step)));
            last = drive;
            if (any(300u) == 0u) {
                (any(2u) == 0u) ? pvid_excite_abort_f32(&self) : pvid_excite_stop_f32(&self);
            }
        }
    }
}

/* A mass that the drive pushes, x'' = g u - c x', with guards as the design makes them. It may be faster than its limit
 * by what the plant does in the ticks in which the drive comes back; beyond a hard limit of x by no more than a tick's
 * travel. */
static void no_draw_leaves_the_limits_of_the_mechanism(void **state)
{
    int turned = 0;
    int aborted = 0;
    for (int k = 0; k < DRAWS; k++) {
        drawn one;
        draw(&one);
        pvid_excite_config_f32 *config = &one.config;
        config->low = -config->high * between(0.7, 1.3);
        config->burst_s = about(300.0, 2000.0) / config->sample_rate_hz;
        const double dt = 1.0 / (double)config->sample_rate_hz;
        const double gain = (double)about(0.01, 100.0) * ((any(2u) == 0u) ? 1.0 : -1.0);
        const double swing = (double)config->high - (double)config->low;
        const double reversal = (swing / (double)config->slew) + (2.0 * dt);
        const double weaker = fmin((double)config->high, -(double)config->low);
        const double strongest = fabs(gain) * fmax((double)config->high, -(double)config->low);
        const double band = strongest * reversal * reversal; /* what the drive may add while it is reversed */
        const double room = band * (double)about(2.0, 100.0);
        const bool limits_speed = any(2u) == 0u;
        const double fastest = strongest * reversal * (double)about(3.0, 30.0);
        const double drag = any(2u) == 0u ? 0.0 : (double)about(0.1, 10.0);
        pvid_excite_guard_f32 *position = &one.guard[limits_speed ? 1 : 0];
        position->signal = 1u;
        position->soft_high = (float)room;
        position->soft_low = -position->soft_high;
        position->high = (float)(room + band);
        position->low = -position->high;
        position->response = (gain > 0.0) ? 1.0f : -1.0f;
        position->push = 1.0f;
        position->ahead_s = (float)reversal;
        position->brake = (float)(0.8 * fabs(gain) * weaker);
        if (limits_speed) {
            pvid_excite_guard_f32 *speed = &one.guard[0];
            *speed = *position;
            speed->of_rate = true;
            speed->soft_high = (float)(0.5 * fastest);
            speed->soft_low = -speed->soft_high;
            speed->high = (float)fastest;
            speed->low = -speed->high;
            speed->ahead_s = 0.0f;
            speed->brake = 0.0f;
        }
        config->guards = limits_speed ? 2u : 1u;
        begin(config);
        double x = room * (double)between(-0.9, 0.9);
        double v = 0.0;
        bool was_turned = false;
        for (int tick = 0; (tick < 3000) && (pvid_excite_state_of_f32(&self) != PVID_EXCITE_ENDED); tick++) {
            const float measured[2] = {0.0f, (float)x};
            const double u = (double)pvid_excite_step_f32(&self, measured);
            if (pvid_excite_reason_of_f32(&self, NULL) != PVID_EXCITE_FINISHED) {
                aborted++;
                break;
            }
            was_turned = was_turned || (fabs(x) > room);
            const double a = (gain * u) - (drag * v);
            x += (v * dt) + (0.5 * a * dt * dt);
            v += a * dt;
            assert_true(fabs(x) <= ((double)position->high + (fabs(v) * dt)));
            if (limits_speed) {
                assert_true(fabs(v) <= (fastest + (strongest * dt)));
            }
        }
        turned += was_turned ? 1 : 0;
    }
    print_message("%d draws, %d turned back beyond a soft limit, %d aborted\n", DRAWS, turned, aborted);
    assert_true(turned > (DRAWS / 20)); /* else nothing was tested */
}

/* ---- init ---- */

static void assert_refused(const pvid_excite_config_f32 *config, pvid_status status)
{
    assert_int_equal(pvid_excite_init_f32(&self, config), status);
    assert_false(pvid_excite_start_f32(&self, 1.0f, 0u));
    assert_true(pvid_excite_step_f32(&self, NULL) == 0.0f);
}

static void every_bad_field_is_refused_by_name(void **state)
{
    const float bad[4] = {NAN, INFINITY, -INFINITY, -1.0e30f};
    for (int k = 0; k < 4; k++) {
        pvid_excite_part_f32 part = sine;
        pvid_excite_guard_f32 guard = {1u, false, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.1f, 1.0f, 0.1f};
#define REFUSED(field, status)                                                                                         \
    do {                                                                                                               \
        pvid_excite_config_f32 config = plain(&part);                                                                  \
        const pvid_excite_part_f32 kept_part = part;                                                                   \
        const pvid_excite_guard_f32 kept_guard = guard;                                                                \
        config.guard = &guard;                                                                                         \
        config.guards = 1u;                                                                                            \
        assert_int_equal(pvid_excite_init_f32(&self, &config), PVID_OK);                                               \
        (field) = bad[k];                                                                                              \
        assert_refused(&config, status);                                                                               \
        part = kept_part;                                                                                              \
        guard = kept_guard;                                                                                            \
    } while (0)
        REFUSED(config.sample_rate_hz, PVID_BAD_SAMPLE_RATE);
        REFUSED(config.low, PVID_BAD_EXCITE_LIMIT);
        REFUSED(config.high, PVID_BAD_EXCITE_LIMIT);
        REFUSED(config.slew, PVID_BAD_EXCITE_SLEW);
        REFUSED(config.ramp_s, PVID_BAD_EXCITE_TIME);
        REFUSED(config.burst_s, PVID_BAD_EXCITE_TIME);
        REFUSED(part.amplitude, PVID_BAD_EXCITE_AMPLITUDE);
        REFUSED(part.hz, PVID_BAD_EXCITE_FREQUENCY);
        REFUSED(part.turns, PVID_BAD_EXCITE_FREQUENCY);
        part.kind = PVID_EXCITE_CHIRP;
        part.to_hz = 10.0f;
        part.sweep_s = 1.0f;
        REFUSED(part.to_hz, PVID_BAD_EXCITE_FREQUENCY);
        REFUSED(part.sweep_s, PVID_BAD_EXCITE_FREQUENCY);
        float level = 1.0f;
        part.kind = PVID_EXCITE_STEPS;
        part.level = &level;
        part.levels = 1u;
        REFUSED(level, PVID_BAD_EXCITE_AMPLITUDE);
        part = sine;
        REFUSED(guard.low, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.soft_low, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.soft_high, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.high, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.response, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.push, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.ahead_s, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.brake, PVID_BAD_EXCITE_GUARD);
        REFUSED(guard.smoothing_s, PVID_BAD_EXCITE_GUARD);
    }
    pvid_excite_config_f32 config = plain(&sine);
    config.parts = 0u;
    assert_refused(&config, PVID_BAD_EXCITE_PARTS);
    config.parts = PVID_EXCITE_PARTS + 1u;
    assert_refused(&config, PVID_BAD_EXCITE_PARTS);
    config = plain(NULL);
    assert_refused(&config, PVID_BAD_EXCITE_PARTS);
    pvid_excite_part_f32 part = sine;
    config = plain(&part);
    part.kind = (pvid_excite_kind)(PVID_EXCITE_STEPS + 1);
    assert_refused(&config, PVID_BAD_EXCITE_PARTS);
    const float level = 1.0f;
    part.kind = PVID_EXCITE_STEPS;
    part.levels = 1u;
    assert_refused(&config, PVID_BAD_EXCITE_PARTS); /* no table */
    part.level = &level;
    part.levels = 0u;
    assert_refused(&config, PVID_BAD_EXCITE_PARTS); /* an empty one */
    config = plain(&sine);
    config.low = 0.0f;
    config.high = 0.0f; /* no range */
    assert_refused(&config, PVID_BAD_EXCITE_LIMIT);
    config = plain(&sine);
    config.sample_rate_hz = 1.0e6f;
    config.burst_s = 3000.0f; /* 3e9 ticks */
    config.slew = 1.0e6f;
    assert_refused(&config, PVID_BAD_EXCITE_TIME);
    config = plain(&sine);
    config.guards = 1u;
    assert_refused(&config, PVID_BAD_EXCITE_GUARD); /* no table */
    const pvid_excite_guard_f32 fits = {1u, false, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.1f, 1.0f, 0.1f};
    pvid_excite_guard_f32 guard[PVID_EXCITE_GUARDS + 1];
    config.guard = guard;
    const pvid_excite_guard_f32 wrong[5] = {
        {2u, false, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.1f, 1.0f, 0.1f}, /* no such signal */
        {1u, true, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.1f, 0.0f, 0.1f},  /* a rate is not looked ahead of */
        {1u, true, -1.0f, -0.8f, 0.8f, 1.0f, 1.0f, 1.0f, 0.0f, 1.0f, 0.1f},  /* nor braked */
        {1u, false, -1.0f, -0.8f, 0.8f, 1.0f, 0.5f, 1.0f, 0.1f, 1.0f, 0.1f}, /* no sign */
        {1u, false, -1.0f, -0.8f, 0.8f, 1.0f, 0.0f, 1.0f, 0.1f, 1.0f, 0.1f}, /* a push to an unknown side */
    };
    for (int i = 0; i < 5; i++) {
        guard[0] = wrong[i];
        assert_refused(&config, PVID_BAD_EXCITE_GUARD);
    }
    for (size_t i = 0; i <= PVID_EXCITE_GUARDS; i++) {
        guard[i] = fits;
    }
    config.guards = PVID_EXCITE_GUARDS + 1u;
    assert_refused(&config, PVID_BAD_EXCITE_GUARD);
    config = plain(&sine);
    config.slew = 1.0e-4f; /* of 5 in a tick: below what a float takes from it */
    assert_refused(&config, PVID_BAD_EXCITE_SLEW);
    assert_int_equal(pvid_excite_init_f32(NULL, &config), PVID_BAD_POINTER);
    assert_int_equal(pvid_excite_init_f32(&self, NULL), PVID_BAD_POINTER);
    assert_int_equal(pvid_excite_state_of_f32(NULL), PVID_EXCITE_IDLE);
    assert_true(pvid_excite_restrained_f32(NULL) == 0.0f);
    uint8_t at = 9u;
    assert_int_equal(pvid_excite_reason_of_f32(NULL, &at), PVID_EXCITE_FINISHED);
    assert_int_equal(at, 0);
    assert_false(pvid_excite_start_f32(NULL, 1.0f, 0u));
    assert_true(pvid_excite_step_f32(NULL, NULL) == 0.0f);
    pvid_excite_stop_f32(NULL);
    pvid_excite_abort_f32(NULL);
}

static void a_table_by_rule_keeps_its_amplitude(void **state)
{
    pvid_excite_part_f32 part[8];
    for (int k = 0; k < 200; k++) {
        const float low = about(0.01, 100.0);
        const float amplitude = about(1.0e-3, 1.0e3);
        const uint8_t parts = pvid_excite_rule_f32(part, amplitude, low, low * about(1.01, 100.0));
        assert_in_range(parts, 1, 8);
        double peak = 0.0;
        for (int i = 0; i < 2000; i++) {
            double sum = 0.0;
            for (size_t j = 0; j < parts; j++) {
                sum += (double)part[j].amplitude *
                       sin(2.0 * PI * (((double)part[j].hz / (double)low * i / 2000.0) + (double)part[j].turns));
            }
            peak = fmax(peak, fabs(sum));
        }
        assert_true((peak > (0.9 * (double)amplitude)) && (peak < (1.2 * (double)amplitude)));
    }
    assert_int_equal(pvid_excite_rule_f32(NULL, 1.0f, 1.0f, 2.0f), 0);
    assert_int_equal(pvid_excite_rule_f32(part, NAN, 1.0f, 2.0f), 0);
    assert_int_equal(pvid_excite_rule_f32(part, 1.0f, 2.0f, 1.0f), 0);
    assert_int_equal(pvid_excite_rule_f32(part, 1.0f, 0.0f, 1.0f), 0);
    assert_int_equal(pvid_excite_rule_f32(part, 1.0e30f, 1.0f, 2.0f), 0);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_tone_is_the_sine_of_the_table),
    cmocka_unit_test(a_chirp_turns_at_its_ends),
    cmocka_unit_test(a_prbs_has_two_levels_and_the_longest_period),
    cmocka_unit_test(steps_follow_their_levels),
    cmocka_unit_test(another_run_is_another_motion),
    cmocka_unit_test(it_starts_softly_and_ends_at_zero),
    cmocka_unit_test(a_stop_is_soft_and_an_abort_falls_at_the_slew_rate),
    cmocka_unit_test(a_sensor_that_is_no_number_or_missing_aborts),
    cmocka_unit_test(no_draw_leaves_the_limits_of_the_drive),
    cmocka_unit_test(no_draw_leaves_the_limits_of_the_mechanism),
    cmocka_unit_test(every_bad_field_is_refused_by_name),
    cmocka_unit_test(a_table_by_rule_keeps_its_amplitude),
};
RUN(tests)
