/* The commissioning of a small mechanism, x' = a u - b x + c + d sgn(u): each verdict, a ring that holds a burst and
 * one that is a queue, aborts, and what init refuses. */
#include "test.h"

#include "first_order.h"
#include "pvid/commission.h"

#define BURST 4000u

static pvid_commission_f32 self;
static pvid_weak_f32 identifier;
static pvid_weak_design_f32 design;
static pvid_weak_config_f32 weak;
static pvid_weak_model_f32 held; /* as of `mechanism`, with an input that is held */
static pvid_weak_signal signals_held[2];
static pvid_excite_f32 excitation[1];
static pvid_excite_part_f32 part[8];
static pvid_excite_guard_f32 guard;
static pvid_excite_config_f32 excite;
static const uint8_t input[1] = {0u};
static float ring[2u * BURST];
static pvid_commission_config_f32 config;

#define NOISE                                                                                                          \
    40.0f /* times that of first_order.h: above what a held input neglects there, whose jumps have no signal */
static const pvid_weak_noise_f32 noisy[2] = {{0, 0, 1, 1, (float)(NOISE * NOISE * SD * SD)},
                                             {0, 1, 4, 4, (float)(NOISE * NOISE * SD * SD)}};

/* The mechanism: exact for an input that is held. */
static first_order rig;
static double gain;     /* of u, 3 in truth */
static float noisiness; /* of the sensor: NOISE, as declared */

static void apply(float u)
{
    const double h = 1.0 / RATE;
    const double sign = (u > 0.0f) ? 1.0 : (u < 0.0f) ? -1.0 : 0.0;
    const double settled = ((gain * (double)u) + truth[2] + (truth[3] * sign)) / truth[1];
    rig.x = settled + ((rig.x - settled) * exp(-truth[1] * h));
}

static void set_up(void)
{
    memcpy(signals_held, signals, sizeof signals);
    signals_held[0].source = PVID_SIGNAL_HELD;
    held = mechanism;
    held.signal = signals_held;
    design = design_of(&held);
    design.noise = noisy;
    weak = config_of(&design);
    const uint8_t parts = pvid_excite_rule_f32(part, 1.0f, 0.4f, 20.0f);
    const pvid_excite_guard_f32 limits = {1u, false, -4.0f, -3.2f, 3.2f, 4.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f};
    guard = limits;
    const pvid_excite_config_f32 drives = {.sample_rate_hz = (float)RATE,
                                           .low = -2.0f,
                                           .high = 2.0f,
                                           .slew = 400.0f,
                                           .ramp_s = 0.5f,
                                           .burst_s = (float)BURST / (float)RATE,
                                           .part = part,
                                           .guard = &guard,
                                           .parts = parts,
                                           .guards = 1u,
                                           .measured = 2u};
    excite = drives;
    const pvid_commission_config_f32 all = {.weak = &weak,
                                            .identifier = &identifier,
                                            .excite = &excite,
                                            .excitation = excitation,
                                            .input = input,
                                            .drives = 1u,
                                            .passes = 2u,
                                            .ring = ring,
                                            .ring_ticks = BURST,
                                            .burst_ticks = BURST,
                                            .check_scale = 0.7f,
                                            .agree = 5.0f,
                                            .misfit_max = 1.5f,
                                            .restrained_max = 0.25f};
    config = all;
    gain = truth[0];
    noisiness = NOISE;
    memset(&rig, 0, sizeof rig);
    rig.generator = 7u;
}

static float largest;

static pvid_commission_state tick(void)
{
    float drive[2] = {9.0f, 0.0f};
    const float sample[2] = {9.0f, (float)rig.x + (noisiness * noise_of(&rig))};
    const pvid_commission_state state = pvid_commission_step_f32(&self, sample, drive);
    assert_true(fabsf(drive[0]) <= 2.0f);
    largest = fmaxf(largest, fabsf(sample[1]));
    apply(drive[0]);
    return state;
}

/* Until the end; `works` calls of work after each tick, and all that are left when the drives rest. */
static const pvid_commission_result_f32 *run(int works)
{
    assert_int_equal(pvid_commission_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_commission_start_f32(&self));
    assert_false(pvid_commission_start_f32(&self));
    pvid_commission_state last = PVID_COMMISSION_IDLE;
    for (int k = 0; k < 200000; k++) {
        const pvid_commission_state state = tick();
        assert_true(state >= last);
        last = state;
        if (state == PVID_COMMISSION_ENDED) {
            break;
        }
        for (int i = 0; i < works; i++) {
            (void)pvid_commission_work_f32(&self);
        }
    }
    assert_int_equal(last, PVID_COMMISSION_ENDED);
    const pvid_commission_result_f32 *result = pvid_commission_result_of_f32(&self);
    assert_true(result->verdict != PVID_COMMISSION_PENDING);
    assert_false(pvid_commission_work_f32(&self));
    return result;
}

static void assert_done(const pvid_commission_result_f32 *result)
{
    assert_int_equal(result->verdict, PVID_COMMISSION_DONE);
    for (int i = 0; i < 4; i++) {
        assert_true((result->error[i] > 0.0f) && (result->error[i] < 0.05f));
        assert_true(fabs((double)result->value[i] - truth[i]) < (5.0 * (double)result->error[i]));
        assert_true(fabs((double)result->check[i] - truth[i]) < (0.05 * truth[0]));
    }
    assert_true((result->difference > 0.0f) && (result->difference < 5.0f));
}

static void it_identifies_and_checks_on_a_second_burst(void **state)
{
    set_up();
    assert_done(run(3));
    assert_true(pvid_commission_start_f32(&self)); /* and again */
}

static void a_short_ring_is_a_queue(void **state)
{
    set_up();
    config.passes = 1u;
    config.ring_ticks = 8u;
    assert_done(run(2));
    assert_int_equal(run(0 + (largest > 1.0e9f))->verdict, PVID_COMMISSION_TOO_SLOW);
    assert_true(self.head == 8u);
}

static void the_outcome_does_not_depend_on_when_work_is_called(void **state)
{
    set_up();
    const pvid_commission_result_f32 first = *run(1);
    set_up();
    const pvid_commission_result_f32 second = *run(1000);
    assert_memory_equal(first.value, second.value, sizeof first.value);
    assert_memory_equal(first.error, second.error, sizeof first.error);
}

static void without_motion_it_is_not_excited(void **state)
{
    set_up();
    for (size_t i = 0; i < excite.parts; i++) {
        part[i].amplitude = 1.0e-6f;
    }
    const pvid_commission_result_f32 *result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_NOT_EXCITED);
    assert_true(result->restrained < 0.01f);
}

static void within_too_tight_limits_it_blames_them(void **state)
{
    set_up();
    guard.soft_low = -0.4f; /* x stays at c / b = 0.25 without a drive */
    guard.soft_high = 0.2505f;
    guard.high = 0.5f;
    guard.low = -0.5f;
    excite.high = 1.0e-3f;
    excite.low = -1.0e-3f;
    excite.slew = 1.0f;
    rig.x = 0.25;
    const pvid_commission_result_f32 *result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_TOO_TIGHT);
    assert_true(result->restrained > 0.25f);
}

static void soft_limits_hold_the_motion_and_hard_ones_abort(void **state)
{
    set_up();
    guard.soft_low = -0.1f;
    guard.soft_high = 0.4f;
    guard.low = -0.3f;
    guard.high = 0.7f;
    largest = 0.0f;
    const pvid_commission_result_f32 *result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_DONE); /* what is applied is what is recorded */
    assert_true((largest > 0.45f) && (largest < 0.7f) && (result->restrained > 0.02f));
    set_up();
    guard.high = 0.3f;
    guard.soft_high = 0.29f;
    guard.soft_low = 0.0f;
    guard.push = 0.0f;
    guard.response = -1.0f; /* wrong: it is pushed outwards */
    result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_ABORTED);
    assert_int_equal(result->reason, PVID_EXCITE_HARD_LIMIT);
    assert_true(excitation[0].drive == 0.0f);
}

static void another_mechanism_in_the_second_burst_does_not_fit(void **state)
{
    set_up();
    assert_int_equal(pvid_commission_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_commission_start_f32(&self));
    while (tick() != PVID_COMMISSION_ENDED) {
        if (pvid_commission_state_of_f32(&self) == PVID_COMMISSION_CHECK) {
            gain = 1.1 * truth[0];
        }
        while (pvid_commission_work_f32(&self)) {
        }
    }
    const pvid_commission_result_f32 *result = pvid_commission_result_of_f32(&self);
    assert_int_equal(result->verdict, PVID_COMMISSION_DOES_NOT_FIT);
    assert_true(result->difference > 5.0f);
    assert_int_equal(result->parameter, 0);
}

static void a_sensor_that_is_noisier_than_declared_does_not_fit(void **state)
{
    set_up();
    noisiness = 4.0f * NOISE;
    const pvid_commission_result_f32 *result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_DOES_NOT_FIT);
    assert_true(result->misfit[0] > config.misfit_max);
    assert_true(result->misfit[1] == 0.0f); /* no second burst */
}

static void assert_refused_as(pvid_status status)
{
    assert_int_equal(pvid_commission_init_f32(&self, &config), status);
    assert_false(pvid_commission_start_f32(&self));
    float drive[2];
    const float sample[2] = {0.0f, 0.0f};
    assert_int_equal(pvid_commission_step_f32(&self, sample, drive), PVID_COMMISSION_IDLE);
    assert_false(pvid_commission_work_f32(&self));
}

/* A second drive, in no sample; it does not move the mechanism. */
static pvid_excite_config_f32 both[2];
static pvid_excite_f32 two[2];
static uint8_t places[2];
static pvid_excite_guard_f32 of_second;

static void set_up_two(void)
{
    set_up();
    both[0] = excite;
    both[1] = excite;
    of_second = guard;
    both[1].guard = &of_second;
    places[0] = 0u;
    places[1] = PVID_COMMISSION_NOWHERE;
    config.excite = both;
    config.excitation = two;
    config.input = places;
    config.drives = 2u;
}

static void a_second_drive_may_be_in_no_sample(void **state)
{
    set_up_two();
    assert_done(run(3));
    set_up_two();
    of_second.soft_high = 0.29f; /* the second drive's own limit, which the first one's motion exceeds */
    of_second.high = 0.3f;
    of_second.push = 0.0f;
    const pvid_commission_result_f32 *result = run(3);
    assert_int_equal(result->verdict, PVID_COMMISSION_ABORTED);
    assert_int_equal(result->reason, PVID_EXCITE_HARD_LIMIT);
    assert_int_equal(result->drive, 1);
    set_up_two();
    both[1].ramp_s = 0.6f;
    assert_refused_as(PVID_BAD_COMMISSION_DRIVES);
    both[1].ramp_s = 0.5f;
    both[1].slew = NAN;
    assert_refused_as(PVID_BAD_EXCITE_SLEW);
    both[1].slew = 400.0f;
    both[0].slew = NAN; /* the first to be refused */
    both[1].low = NAN;
    assert_refused_as(PVID_BAD_EXCITE_SLEW);
}

static void it_is_aborted_in_every_state(void **state)
{
    for (int at = 0; at < 40; at++) {
        set_up();
        assert_int_equal(pvid_commission_init_f32(&self, &config), PVID_OK);
        assert_true(pvid_commission_start_f32(&self));
        for (int k = 0; (k < (at * 500)) && (tick() != PVID_COMMISSION_ENDED); k++) {
            (void)pvid_commission_work_f32(&self);
        }
        pvid_commission_abort_f32(&self);
        int ticks = 0;
        while ((tick() != PVID_COMMISSION_ENDED) && (ticks < 100)) {
            (void)pvid_commission_work_f32(&self);
            ticks++;
        }
        assert_true(ticks < 10); /* 2 at 400 a second, and one of work */
        const pvid_commission_result_f32 *result = pvid_commission_result_of_f32(&self);
        assert_true((result->verdict == PVID_COMMISSION_ABORTED) || (result->verdict == PVID_COMMISSION_DONE));
        assert_true((result->verdict == PVID_COMMISSION_DONE) || (result->reason == PVID_EXCITE_ASKED));
    }
}

static void a_sensor_that_fails_aborts(void **state)
{
    set_up();
    assert_int_equal(pvid_commission_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_commission_start_f32(&self));
    for (int k = 0; k < 1000; k++) {
        (void)tick();
    }
    float drive[1];
    const float bad[2] = {0.0f, NAN};
    while (pvid_commission_step_f32(&self, bad, drive) != PVID_COMMISSION_ENDED) {
    }
    assert_int_equal(pvid_commission_result_of_f32(&self)->verdict, PVID_COMMISSION_ABORTED);
    assert_int_equal(pvid_commission_result_of_f32(&self)->reason, PVID_EXCITE_SENSOR);
    assert_true(pvid_commission_start_f32(&self));
    for (int k = 0; k < 1000; k++) {
        (void)tick();
    }
    assert_int_equal(pvid_commission_step_f32(&self, bad, NULL), PVID_COMMISSION_IDLE); /* nowhere to write drives */
    while (pvid_commission_step_f32(&self, NULL, drive) != PVID_COMMISSION_ENDED) {
    }
    assert_int_equal(pvid_commission_result_of_f32(&self)->reason, PVID_EXCITE_SENSOR);
}

static void without_a_drive_it_identifies_what_moves_by_itself(void **state)
{
    set_up();
    config.drives = 0u;
    assert_int_equal(pvid_commission_init_f32(&self, &config), PVID_OK);
    assert_true(pvid_commission_start_f32(&self));
    float u = 0.0f;
    for (int k = 0; k < 20000; k++) {
        u = (float)sin(0.03 * k) + (((k / 37) % 2) == 0 ? 0.7f : -0.7f);
        const float sample[2] = {u, (float)rig.x + (NOISE * noise_of(&rig))};
        if (pvid_commission_step_f32(&self, sample, NULL) == PVID_COMMISSION_ENDED) {
            break;
        }
        apply(u);
        while (pvid_commission_work_f32(&self)) {
        }
    }
    assert_done(pvid_commission_result_of_f32(&self));
}

static void assert_refused(pvid_status status)
{
    assert_refused_as(status);
    set_up();
}

static void every_bad_field_is_refused_by_name(void **state)
{
    set_up();
    const float bad[3] = {NAN, -1.0f, 1.0e30f};
    for (int k = 0; k < 3; k++) {
        float *const checks[4] = {&config.check_scale, &config.agree, &config.misfit_max, &config.restrained_max};
        for (int i = 0; i < 4; i++) {
            *checks[i] = bad[k];
            assert_refused(PVID_BAD_COMMISSION_CHECK);
        }
    }
    config.passes = 0u;
    assert_refused(PVID_BAD_COMMISSION_RING);
    config.passes = 9u;
    assert_refused(PVID_BAD_COMMISSION_RING);
    config.ring_ticks = BURST - 1u; /* two passes over what is not there */
    assert_refused(PVID_BAD_COMMISSION_RING);
    config.burst_ticks = 1u;
    assert_refused(PVID_BAD_COMMISSION_RING);
    config.burst_ticks = BURST + 1u;
    assert_refused(PVID_BAD_COMMISSION_DRIVES);
    config.drives = 5u;
    assert_refused(PVID_BAD_COMMISSION_DRIVES);
    excite.measured = 3u;
    assert_refused(PVID_BAD_COMMISSION_DRIVES);
    excite.sample_rate_hz = 100.0f;
    assert_refused(PVID_BAD_COMMISSION_DRIVES);
    excite.slew = NAN;
    assert_refused(PVID_BAD_EXCITE_SLEW);
    weak.iterations = 0u;
    assert_refused(PVID_BAD_ITERATIONS);
    const void *const no_pointer = NULL;
    const size_t pointers[6] = {
        offsetof(pvid_commission_config_f32, weak),   offsetof(pvid_commission_config_f32, identifier),
        offsetof(pvid_commission_config_f32, excite), offsetof(pvid_commission_config_f32, excitation),
        offsetof(pvid_commission_config_f32, input),  offsetof(pvid_commission_config_f32, ring)};
    for (int i = 0; i < 6; i++) {
        memcpy((char *)&config + pointers[i], &no_pointer, sizeof no_pointer);
        assert_refused(PVID_BAD_POINTER);
    }
    uint32_t *const lengths[2] = {&config.ring_ticks, &config.burst_ticks};
    config.passes = 1u;
    for (int i = 0; i < 2; i++) {
        *lengths[i] = 1u;
        assert_refused(PVID_BAD_COMMISSION_RING);
        excite.burst_s = 1.0e5f;
        *lengths[i] = 16777217u;
        assert_refused(PVID_BAD_COMMISSION_RING);
    }
    const uint8_t outside[1] = {2u};
    config.input = outside;
    assert_refused(PVID_BAD_COMMISSION_DRIVES);
    assert_int_equal(pvid_commission_init_f32(NULL, &config), PVID_BAD_POINTER);
    assert_int_equal(pvid_commission_init_layout_f32(&self, &config, PVID_LAYOUT + 1u), PVID_BAD_LAYOUT);
    assert_int_equal(pvid_commission_state_of_f32(NULL), PVID_COMMISSION_IDLE);
    assert_null(pvid_commission_result_of_f32(NULL));
    float drive[1];
    assert_int_equal(pvid_commission_step_f32(NULL, drive, drive), PVID_COMMISSION_IDLE);
    assert_false(pvid_commission_work_f32(NULL));
    assert_false(pvid_commission_start_f32(NULL));
    pvid_commission_abort_f32(NULL);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(it_identifies_and_checks_on_a_second_burst),
    cmocka_unit_test(a_short_ring_is_a_queue),
    cmocka_unit_test(the_outcome_does_not_depend_on_when_work_is_called),
    cmocka_unit_test(without_motion_it_is_not_excited),
    cmocka_unit_test(within_too_tight_limits_it_blames_them),
    cmocka_unit_test(soft_limits_hold_the_motion_and_hard_ones_abort),
    cmocka_unit_test(another_mechanism_in_the_second_burst_does_not_fit),
    cmocka_unit_test(a_sensor_that_is_noisier_than_declared_does_not_fit),
    cmocka_unit_test(a_second_drive_may_be_in_no_sample),
    cmocka_unit_test(it_is_aborted_in_every_state),
    cmocka_unit_test(a_sensor_that_fails_aborts),
    cmocka_unit_test(without_a_drive_it_identifies_what_moves_by_itself),
    cmocka_unit_test(every_bad_field_is_refused_by_name),
};
RUN(tests)
