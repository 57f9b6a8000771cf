/* A robot of one joint, a driven pendulum: what is identified, refused, restarted, forgotten. */
#include "test.h"

#include "pvid/elementary.h"
#include "pvid/robot.h"

#define P 4u
#define L 5u
#define MOST_D 3u
#define TAPS 11u
#define HALF (TAPS / 2u)
#define RATE 200.0f
#define ROOM 512u
#define PI 3.14159265358979

static const uint16_t end[1] = {P};
static const uint8_t column[P] = {0, 1, 2, 3};
static const uint16_t slot[4] = {1, 2, 3, 0};
static const float gain[1] = {2.0f}; /* N*m per ampere */
static const float share[P] = {1.0f, 1.0f, 1.0f, 0.5f};
static const bool held[1] = {false};

/* tau = d/dt (J q') + w sin q + Fv q' + Fc sgn q'. */
static void values(const float in[], float out[])
{
    out[0] = pvid_sin_f32(in[0]);
    out[1] = in[1];
    out[2] = in[2];
    out[3] = in[1];
}

static const pvid_robot_model_f32 model = {.joints = 1,
                                           .p = P,
                                           .forces = 3,
                                           .entries = 4,
                                           .end = end,
                                           .column = column,
                                           .slot = slot,
                                           .gain = gain,
                                           .share = share,
                                           .held = held,
                                           .values = values};
static float position[HALF];
static float rate[HALF];
static float spline[4u * L];
static float slope[4u * L];
static float torque[8u * L * MOST_D];
static float added[2u * PVID_ROBOT_NOISE];
static float noise_sd[1];
static float blur; /* of the encoder [rad] */
static bool rests; /* half of the time */
static unsigned decimation = MOST_D;
static const float start[P] = {0.1f, 1.0f, 0.0f, 0.0f};
static const float start_sd[P] = {10.0f, 10.0f, 10.0f, 10.0f};
static const double truth[P] = {0.3, 2.0, 0.2, 0.5};
static pvid_robot_f32 robot;
static float memory[ROOM];

static double power(double u, int n)
{
    return (u > 0.0) ? pow(u, n) : 0.0;
}

static double b_spline(double u, int degree)
{
    static const double binomial[2][5] = {{1, -3, 3, -1, 0}, {1, -4, 6, -4, 1}};
    double sum = 0.0;
    for (int j = 0; j < 5; j++) {
        sum += binomial[degree - 2][j] * power(u - j, degree);
    }
    return sum / ((degree == 2) ? 2.0 : 6.0);
}

/* White, with sd 1. */
static double random_at(unsigned k)
{
    uint32_t x = (k + 1u) * 2654435761u;
    x = (x ^ (x >> 15)) * 2246822519u;
    x = (x ^ (x >> 13)) * 3266489917u;
    return sqrt(12.0) * (((x ^ (x >> 16)) % 100000u) / 100000.0 - 0.5);
}

/* Local lines instead of polynomials of degree 4: enough for a slow motion. */
static pvid_robot_design_f32 design_of(void)
{
    const double ticks = (double)L * (double)decimation;
    for (unsigned i = 0; i < HALF; i++) {
        position[i] = 0.0f;
        rate[i] = (i == 0u) ? (RATE * 8.0f / 12.0f) : ((i == 1u) ? (-RATE / 12.0f) : 0.0f);
    }
    for (unsigned i = 0; i < (4u * L); i++) {
        const double u = (double)i / (double)L;
        spline[i] = (float)b_spline(u, 3);
        slope[i] = (float)(-(b_spline(u, 2) - b_spline(u - 1.0, 2)) * (double)RATE / ticks);
    }
    const unsigned half = 4u * L * decimation;
    for (unsigned i = 0; i < (2u * half); i++) {
        const double u = (double)(i % half) / ticks + ((i < half) ? 0.0 : 0.5 / ticks);
        torque[i] = (float)(b_spline(u, 3) / (double)decimation);
    }
    for (unsigned i = 0; i < PVID_ROBOT_NOISE; i++) {
        double white[5];
        for (unsigned k = 0; k < 5u; k++) {
            white[k] = random_at(((i * decimation) + k) % (PVID_ROBOT_NOISE * decimation));
        }
        added[i] = (float)white[2];
        added[PVID_ROBOT_NOISE + i] =
            (float)((double)rate[0] * (white[3] - white[1]) + (double)rate[1] * (white[4] - white[0]));
    }
    noise_sd[0] = blur;
    return (pvid_robot_design_f32){TAPS,     (uint8_t)decimation,     L, position, rate, spline, slope, torque, added,
                                   noise_sd, {1.0f, 0.0f, 0.0f, 0.0f}};
}

static pvid_robot_design_f32 design;

static pvid_robot_config_f32 config_of(void)
{
    design = design_of();
    return (pvid_robot_config_f32){&model, &design, start, start_sd, 20, 1000};
}

static void begin(void)
{
    const pvid_robot_config_f32 config = config_of();
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
}

/* The joint and the current of its motor at a tick, with a parameter w. */
static void sample_at(unsigned tick, double w, float sample[2])
{
    const double noise = ((tick * 2654435761u) % 1000u) / 1000.0 - 0.5;
    double t = tick / (double)RATE;
    double speed = 1.0; /* dt of the motion */
    double more = 0.0;
    if (rests) { /* 2 s of motion, 2 s of rest, where friction carries a part of the load */
        const double x = t - (4.0 * floor(t / 4.0));
        const bool still = x > 2.0;
        speed = still ? 0.0 : (1.0 - cos(PI * x));
        more = still ? 0.0 : (PI * sin(PI * x));
        t = (2.0 * floor(t / 4.0)) + (still ? 2.0 : (x - (sin(PI * x) / PI)));
    }
    const double q = sin(1.3 * t) + 0.6 * sin(2.9 * t + 1.0) + 0.3 * cos(4.1 * t);
    const double pace = 1.3 * cos(1.3 * t) + 1.74 * cos(2.9 * t + 1.0) - 1.23 * sin(4.1 * t);
    const double v = pace * speed;
    const double a =
        ((-1.69 * sin(1.3 * t) - 5.046 * sin(2.9 * t + 1.0) - 5.043 * cos(4.1 * t)) * speed * speed) + (pace * more);
    const double dry = (speed == 0.0) ? (-0.6 * sin(q)) : ((v > 0.0) ? 1.0 : -1.0);
    const double tau = truth[0] * a + w * sin(q) + truth[2] * v + truth[3] * dry + 0.1 * noise;
    sample[0] = (float)(q + (double)blur * random_at(tick + 777777u));
    sample[1] = (float)(tau / 2.0);
}

static unsigned play(unsigned from, unsigned to, double w)
{
    unsigned updates = 0;
    for (unsigned tick = from; tick < to; tick++) {
        float sample[2];
        sample_at(tick, w, sample);
        updates += (pvid_robot_step_f32(&robot, sample) == PVID_UPDATED) ? 1u : 0u;
    }
    return updates;
}

static void require_truth(double w)
{
    float estimate[2u * P];
    uint32_t number = 0;
    assert_true(pvid_robot_read_f32(&robot, estimate, &number));
    assert_true(number > 0u);
    for (unsigned k = 0; k < P; k++) {
        const double expected = (k == 1u) ? w : truth[k];
        const double error = (double)estimate[k] - expected;
        assert_true((estimate[P + k] > 0.0f) && (estimate[P + k] < 0.02f));
        /* 4 standard errors, and 0.5 % of what lines and the steps lack. */
        assert_true(fabs(error) < 4.0 * (double)estimate[P + k] + 0.005 * expected);
    }
}

static void the_parameters_of_a_joint_are_found_with_their_errors(void **state)
{
    begin();
    assert_true(play(0, 6000, 2.0) > 10u);
    require_truth(2.0);
}

static void noise_of_the_encoder_does_not_move_the_parameters(void **state)
{
    float of[2][2u * P];
    blur = 0.001f; /* the noise of the rate is a tenth of the rate */
    for (unsigned corrected = 0; corrected < 2u; corrected++) {
        pvid_robot_config_f32 config = config_of();
        config.memory = 10000;
        noise_sd[0] = (corrected == 1u) ? blur : 0.0f;
        assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
        (void)play(0, 48000, 2.0);
        assert_true(pvid_robot_read_f32(&robot, of[corrected], NULL));
    }
    blur = 0.0f;
    for (unsigned k = 0; k < 2u; k++) { /* J from -0.020 to -0.004, w from -0.106 to -0.024 */
        const double off = fabs((double)of[0][k] - truth[k]);
        assert_true((off > 8.0 * (double)of[0][P + k]) && (fabs((double)of[1][k] - truth[k]) < 0.3 * off));
    }
}

static void more_noise_than_motion_is_not_published(void **state)
{
    static const float loud[2] = {0.003f, 0.02f}; /* the noise of the rate is 0.3 and twice the rate */
    for (unsigned k = 0; k < 2u; k++) {
        blur = loud[k];
        pvid_robot_config_f32 config = config_of();
        config.memory = 300;
        assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
        float sample[2];
        unsigned uncertain = 0;
        unsigned number = 0;
        for (unsigned tick = 0; tick < 48000u; tick++) {
            sample_at(tick, 2.0, sample);
            const pvid_reason reason = pvid_robot_step_f32(&robot, sample);
            number += (reason == PVID_UPDATED) ? 1u : 0u;
            uncertain += ((reason == PVID_HELD_UNCERTAIN) || (reason == PVID_HELD_SINGULAR)) ? 1u : 0u;
        }
        assert_true(robot.rows[0] <= (config.memory + 20u)); /* rows grow old whether or not estimates are held */
        assert_true((k == 0u) ? ((number > 20u) && (uncertain < number)) : ((number == 0u) && (uncertain > 20u)));
    }
    blur = 0.0f;
}

static void the_covariance_has_the_standard_errors(void **state)
{
    blur = 0.001f;
    begin();
    blur = 0.0f; /* of the rest: columns are expected to be noisy, and are not */
    float column_of[P];
    assert_false(pvid_robot_covariance_f32(&robot, 0, column_of));
    float sample[2];
    pvid_reason reason = PVID_WARMING_UP;
    for (unsigned tick = 0; (reason != PVID_UPDATED) || (tick < 3000u); tick++) {
        sample_at(tick, 2.0, sample);
        reason = pvid_robot_step_f32(&robot, sample);
    }
    float estimate[2u * P];
    float whole[P][P];
    assert_true(pvid_robot_read_f32(&robot, estimate, NULL));
    for (uint8_t k = 0; k < P; k++) {
        assert_true(pvid_robot_covariance_f32(&robot, k, whole[k]));
        assert_float_equal(sqrtf(whole[k][k]), estimate[P + k], 1.0e-5f * estimate[P + k]); /* a few roundings */
    }
    for (unsigned k = 0; k < P; k++) {
        for (unsigned i = 0; i < k; i++) {
            assert_float_equal(whole[k][i], whole[i][k], 1.0e-5f * estimate[P + k] * estimate[P + i]);
        }
    }
    assert_false(pvid_robot_covariance_f32(&robot, P, column_of));
}

static void a_changed_joint_is_followed_with_a_short_memory(void **state)
{
    pvid_robot_config_f32 config = config_of();
    config.memory = 100;
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
    (void)play(0, 6000, 2.0);
    (void)play(6000, 24000, 2.5); /* 1200 rows: the older ones count 2^-10 */
    require_truth(2.5);
    assert_true(robot.rows[0] <= 120u);
}

static void what_is_not_finite_restarts_the_splines_and_keeps_the_sums(void **state)
{
    begin();
    (void)play(0, 6000, 2.0);
    const uint32_t rows = robot.rows[0];
    const float bad[2] = {1.0f, NAN};
    assert_int_equal(pvid_robot_step_f32(&robot, bad), PVID_REJECTED_NOT_FINITE);
    assert_int_equal(robot.rejected, 1);
    assert_int_equal(play(6001, 6001 + TAPS + (3u * L * MOST_D), 2.0), 0);
    assert_true((robot.rows[0] == rows) && (robot.filled == TAPS));
    (void)play(6001 + TAPS + (3u * L * MOST_D), 9000, 2.0);
    assert_true(robot.rows[0] > rows);
    require_truth(2.0);
}

static void without_motion_nothing_is_published(void **state)
{
    begin();
    float estimate[2u * P];
    uint32_t number = 1;
    unsigned held_ticks = 0;
    for (unsigned tick = 0; tick < 3000u; tick++) {
        const float still[2] = {0.0f, 0.01f};
        const pvid_reason reason = pvid_robot_step_f32(&robot, still);
        assert_int_not_equal(reason, PVID_REJECTED_SATURATED);
        assert_int_not_equal(reason, PVID_UPDATED);
        held_ticks += (reason == PVID_HELD_NOT_EXCITED) ? 1u : 0u;
    }
    assert_true(pvid_robot_read_f32(&robot, estimate, &number));
    assert_int_equal(number, 0);
    assert_true(held_ticks > 150u);
    assert_int_equal(robot.held + robot.rows[0], 0);
    for (unsigned k = 0; k < P; k++) {
        assert_float_equal(estimate[k], start[k], 0.0f);
        assert_float_equal(estimate[P + k], start_sd[k], 1.0e-4f);
    }
    pvid_robot_gap_f32(&robot); /* a jump to the first sample is no motion */
    (void)play(0, 6000, 2.0);
    require_truth(2.0);
}

static void a_joint_that_has_rested_is_found_when_it_moves(void **state)
{
    blur = 3.0e-4f;
    begin();
    float sample[2] = {0.0f, 0.01f};
    for (unsigned tick = 0; tick < 120000u; tick++) {
        sample[0] = blur * (float)random_at(tick);
        assert_int_not_equal(pvid_robot_step_f32(&robot, sample), PVID_UPDATED);
    }
    assert_true(robot.rows[0] < 80u); /* of 8000 */
    assert_true(play(0, 20000, 2.0) > 20u);
    blur = 0.0f;
    require_truth(2.0);
}

/* At rest friction is any torque: with the rows of it J was 13 standard errors off. */
static void a_joint_that_rests_half_of_the_time_has_its_parameters(void **state)
{
    blur = 3.0e-4f;
    rests = true;
    pvid_robot_config_f32 config = config_of();
    config.memory = 10000;
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
    assert_true(play(0, 80000, 2.0) > 80u);
    rests = false;
    blur = 0.0f;
    assert_true((robot.rows[0] > 2000u) && (robot.rows[0] < 2667u)); /* of 5333 */
    require_truth(2.0);
}

static void one_sample_out_of_range_costs_its_splines_alone(void **state)
{
    static const float bad[5][2] = {
        {16385.0f, 0.0f}, {0.0f, 3.0e38f}, {0.0f, -9.0e8f}, {16383.0f, 0.0f}, {-16383.0f, 1.0e3f}};
    for (unsigned k = 0; k < 5u; k++) {
        begin();
        (void)play(0, 1000, 2.0);
        unsigned samples = 1;
        if (k == 2u) { /* a whole spline of them: its row is beyond 1e9 */
            pvid_robot_gap_f32(&robot);
            samples = TAPS + (5u * L * MOST_D);
        }
        bool saturated = false;
        for (unsigned tick = 0; tick < samples; tick++) {
            const float sample[2] = {bad[k][0] + (0.001f * (float)(tick % 7u)), bad[k][1]}; /* it does not rest */
            saturated = (pvid_robot_step_f32(&robot, sample) == PVID_REJECTED_SATURATED) || saturated;
        }
        assert_true(saturated == (k < 3u));
        (void)play(1000u + samples, 6000, 2.0);
        assert_int_equal(robot.rejected, (k < 2u) ? 1u : 0u);
        assert_int_equal(robot.saturated, (k == 2u) ? 1u : 0u);
        assert_true((robot.outliers > 0u) || (k < 3u));
        require_truth(2.0);
    }
}

static void without_accepted_rows_nothing_is_published(void **state)
{
    begin();
    (void)play(0, 6000, 2.0);
    const uint32_t number = robot.number;
    const uint32_t rows = robot.rows[0];
    for (unsigned tick = 0; tick < 6000u; tick++) {
        const float huge[2] = {0.001f * (float)(tick % 7u), 9.0e8f};
        assert_int_not_equal(pvid_robot_step_f32(&robot, huge), PVID_UPDATED);
    }
    assert_true((robot.number == number) && (robot.rows[0] == rows) && (robot.saturated > 10u));
    assert_true(play(6000, 12000, 2.0) > 10u);
    require_truth(2.0);
}

static void a_turn_too_many_is_an_outlier(void **state)
{
    begin();
    (void)play(0, 30000, 2.0);
    float before[2u * P];
    float after[2u * P];
    assert_true(pvid_robot_read_f32(&robot, before, NULL));
    float sample[2];
    sample_at(30000, 2.0, sample);
    sample[0] += 6.2831853f;
    assert_true(pvid_robot_step_f32(&robot, sample) <= PVID_ACCUMULATED);
    assert_true(play(30001, 31000, 2.0) > 0u);
    assert_true((robot.outliers > 0u) && (robot.outliers < 3u));
    assert_true(pvid_robot_read_f32(&robot, after, NULL));
    for (unsigned k = 0; k < P; k++) {
        assert_true(fabsf(after[k] - before[k]) < before[P + k]);
    }
    require_truth(2.0);
}

static void a_joint_that_became_another_opens_the_gate(void **state)
{
    pvid_robot_config_f32 config = config_of();
    config.memory = 100;
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
    (void)play(0, 6000, 2.0);
    const uint32_t before = robot.outliers;
    (void)play(6000, 30000, 20.0);
    assert_true((robot.outliers > before) && (robot.outliers < before + 20u));
    require_truth(20.0);
}

static void errors_do_not_depend_on_a_bad_start(void **state)
{
    static const float far_off[P] = {2.0e5f, -3.0e5f, 1.0e5f, 1.5e5f};
    static const float wide[P] = {1.0e7f, 1.0e7f, 1.0e7f, 1.0e7f};
    static const float near_by[P] = {0.3f, 2.0f, 0.2f, 0.5f};
    float estimate[2][2u * P];
    double rows[2];
    for (unsigned k = 0; k < 2u; k++) {
        pvid_robot_config_f32 config = config_of();
        config.start = (k == 0u) ? far_off : near_by;
        config.start_sd = wide;
        assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
        (void)play(0, 12000, 2.0); /* the joint begins again until 2 500 */
        require_truth(2.0);
        assert_true(pvid_robot_read_f32(&robot, estimate[k], NULL));
        rows[k] = (double)robot.rows[0];
    }
    for (unsigned k = P; k < (2u * P); k++) { /* of as many rows */
        const double ratio = (double)estimate[0][k] / (double)estimate[1][k] * sqrt(rows[0] / rows[1]);
        assert_true(fabs(ratio - 1.0) < 0.15);
    }
}

static void a_step_of_one_and_of_two_ticks_is_taken(void **state)
{
    for (decimation = 1; decimation < MOST_D; decimation++) {
        begin();
        assert_true(play(0, 6000, 2.0) > 10u);
        require_truth(2.0);
    }
    decimation = MOST_D;
}

/* Bits at random, of which many are infinities, NaN and huge: whatever is stored stays finite. */
static void after_garbage_the_truth_is_found(void **state)
{
    pvid_robot_config_f32 config = config_of();
    config.memory = 8u * P;
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
    uint32_t word = 1;
    for (unsigned tick = 0; tick < 60000u; tick++) {
        float sample[2];
        for (unsigned k = 0; k < 2u; k++) {
            word = (word * 1664525u) + 1013904223u;
            const uint32_t exponent = 100u + ((word >> 8u) % ((k == 0u) ? 41u : 57u)); /* most are within the limits */
            const uint32_t bits = (tick % 64u < 60u) ? ((word & 0x807FFFFFu) | (exponent << 23u)) : word;
            memcpy(&sample[k], &bits, sizeof bits);
        }
        assert_true(pvid_robot_step_f32(&robot, sample) <= PVID_NOT_READY);
    }
    assert_true(robot.rejected > 0u);
    for (uint32_t i = robot.at.s; i < robot.at.f + robot.slots; i++) {
        assert_true(isfinite(memory[i]));
    }
    for (uint32_t i = robot.at.p; i < robot.at.next; i++) {
        assert_true(isfinite(memory[i]));
    }
    pvid_robot_gap_f32(&robot);
    (void)play(0, 60000, 2.0);
    require_truth(2.0);
}

static void refuse(const pvid_robot_config_f32 *config, pvid_status status)
{
    memset(&robot, 0xFF, sizeof robot);
    assert_int_equal(pvid_robot_init_f32(&robot, config, memory, ROOM), status);
    if ((status == PVID_BAD_MODEL) || (status == PVID_BAD_DESIGN)) {
        assert_int_equal(pvid_robot_memory_f32(config->model, config->design), 0);
    }
    const float sample[2] = {0.0f, 0.0f};
    assert_int_equal(pvid_robot_step_f32(&robot, sample), PVID_NOT_READY);
}

static void what_is_out_of_range_is_refused_by_its_status(void **state)
{
    const pvid_robot_config_f32 sound = config_of();
    pvid_robot_config_f32 config = sound;
    config.model = NULL;
    refuse(&config, PVID_BAD_POINTER);
    config = sound;
    config.design = NULL;
    refuse(&config, PVID_BAD_POINTER);
    assert_int_equal(pvid_robot_memory_f32(NULL, &design), 0);
    assert_int_equal(pvid_robot_memory_f32(&model, NULL), 0);
    assert_int_equal(pvid_robot_init_f32(&robot, &sound, NULL, ROOM), PVID_BAD_POINTER);
    assert_int_equal(pvid_robot_init_f32(NULL, &sound, memory, ROOM), PVID_BAD_POINTER);

    pvid_robot_model_f32 other = model;
    config = sound;
    config.model = &other;
#define REFUSE_MODEL(field, value)                                                                                     \
    do {                                                                                                               \
        other = model;                                                                                                 \
        other.field = value;                                                                                           \
        refuse(&config, PVID_BAD_MODEL);                                                                               \
    } while (0)
    static const uint16_t long_end[1] = {P + 1u};
    static const uint8_t twice[P] = {0, 1, 1, 3};
    static const uint8_t high[P] = {0, 1, 2, 4};
    static const uint16_t beyond[4] = {1, 2, 3, 4};
    static const float no_gain[1] = {0.0f};
    static const float infinite_gain[1] = {INFINITY};
    REFUSE_MODEL(p, 0);
    REFUSE_MODEL(p, 65);
    REFUSE_MODEL(joints, 0);
    REFUSE_MODEL(joints, 13);
    REFUSE_MODEL(entries, 0);
    REFUSE_MODEL(forces, 5);
    REFUSE_MODEL(end, NULL);
    static const float high_share[P] = {1.0f, 1.0f, 1.5f, 1.0f};
    REFUSE_MODEL(end, long_end);
    REFUSE_MODEL(column, NULL);
    REFUSE_MODEL(column, twice);
    REFUSE_MODEL(column, high);
    REFUSE_MODEL(slot, NULL);
    REFUSE_MODEL(slot, beyond);
    REFUSE_MODEL(gain, NULL);
    REFUSE_MODEL(gain, no_gain);
    REFUSE_MODEL(gain, infinite_gain);
    REFUSE_MODEL(share, NULL);
    REFUSE_MODEL(share, high_share);
    REFUSE_MODEL(held, NULL);
    REFUSE_MODEL(values, NULL);

    config = sound;
#define REFUSE_DESIGN(field, value)                                                                                    \
    do {                                                                                                               \
        design = design_of();                                                                                          \
        design.field = value;                                                                                          \
        refuse(&config, PVID_BAD_DESIGN);                                                                              \
    } while (0)
    REFUSE_DESIGN(taps, 10);
    REFUSE_DESIGN(taps, 1);
    REFUSE_DESIGN(taps, 1025);
    REFUSE_DESIGN(decimation, 0);
    REFUSE_DESIGN(interval, 2);
    REFUSE_DESIGN(position, NULL);
    REFUSE_DESIGN(rate, NULL);
    REFUSE_DESIGN(spline, NULL);
    REFUSE_DESIGN(slope, NULL);
    REFUSE_DESIGN(torque, NULL);
    REFUSE_DESIGN(noise, NULL);
    REFUSE_DESIGN(noise_sd, NULL);
    REFUSE_DESIGN(white[0], 0.0f);
    REFUSE_DESIGN(white[0], NAN);
    REFUSE_DESIGN(white[1], 2.0f);  /* a zero at 2 */
    REFUSE_DESIGN(white[1], -1.0f); /* at -1 */
    REFUSE_DESIGN(white[2], -1.1f); /* a pair at 1.05 i */
    REFUSE_DESIGN(white[3], -1.0f);
    REFUSE_DESIGN(white[3], INFINITY);
    design = design_of();
    spline[3] = NAN;
    refuse(&config, PVID_BAD_DESIGN);
    design = design_of();
    torque[3] = 2.0e9f;
    refuse(&config, PVID_BAD_DESIGN);
    design = design_of();
    design.white[1] = 1.4f; /* a pair at 0.7 +- 0.64 i */
    design.white[2] = -0.9f;
    assert_int_equal(pvid_robot_init_f32(&robot, &sound, memory, ROOM), PVID_OK);

    design = design_of();
    design.interval = 3;
    design.decimation = 1;
    config.group = 3;
    refuse(&config, PVID_BAD_WINDOW);
    config = config_of();
    config.group = 8; /* 16 stages and a beginning need 9 intervals: of 5 ticks two are for the row, one ends it */
    refuse(&config, PVID_BAD_WINDOW);
    config.group = 9;
    assert_int_equal(pvid_robot_init_f32(&robot, &config, memory, ROOM), PVID_OK);
    config.group = 0;
    refuse(&config, PVID_BAD_WINDOW);
    static const float infinite[P] = {0.0f, INFINITY, 0.0f, 0.0f};
    config = sound;
    config.start = infinite;
    refuse(&config, PVID_BAD_START);
    static const float huge[P] = {0.0f, 3.0e38f, 0.0f, 0.0f};
    config.start = huge;
    refuse(&config, PVID_BAD_START);
    config.start = NULL;
    refuse(&config, PVID_BAD_START);
    static const float zero[P] = {1.0f, 0.0f, 1.0f, 1.0f};
    config = sound;
    config.start_sd = zero;
    refuse(&config, PVID_BAD_START_SD);
    config.start_sd = NULL;
    refuse(&config, PVID_BAD_START_SD);
    config = sound;
    config.memory = (8u * P) - 1u;
    refuse(&config, PVID_BAD_FORGETTING);
    config.memory = 1048577;
    refuse(&config, PVID_BAD_FORGETTING);
    assert_int_equal(pvid_robot_init_f32(&robot, &sound, memory, pvid_robot_memory_f32(&model, &design) - 1u),
                     PVID_BAD_LAYOUT);
    assert_int_equal(pvid_robot_init_f32(&robot, &sound, memory, pvid_robot_memory_f32(&model, &design)), PVID_OK);
}

static void before_init_nothing_is_done(void **state)
{
    float estimate[2u * P];
    memset(&robot, 0, sizeof robot);
    pvid_robot_gap_f32(&robot);
    pvid_robot_gap_f32(NULL);
    assert_int_equal(pvid_robot_step_f32(&robot, estimate), PVID_NOT_READY);
    assert_int_equal(pvid_robot_step_f32(NULL, estimate), PVID_NOT_READY);
    assert_false(pvid_robot_read_f32(&robot, estimate, NULL) || pvid_robot_read_f32(NULL, estimate, NULL));
    assert_false(pvid_robot_covariance_f32(&robot, 0, estimate));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(the_parameters_of_a_joint_are_found_with_their_errors),
    cmocka_unit_test(noise_of_the_encoder_does_not_move_the_parameters),
    cmocka_unit_test(more_noise_than_motion_is_not_published),
    cmocka_unit_test(the_covariance_has_the_standard_errors),
    cmocka_unit_test(a_changed_joint_is_followed_with_a_short_memory),
    cmocka_unit_test(what_is_not_finite_restarts_the_splines_and_keeps_the_sums),
    cmocka_unit_test(a_joint_that_has_rested_is_found_when_it_moves),
    cmocka_unit_test(a_joint_that_rests_half_of_the_time_has_its_parameters),
    cmocka_unit_test(one_sample_out_of_range_costs_its_splines_alone),
    cmocka_unit_test(without_accepted_rows_nothing_is_published),
    cmocka_unit_test(a_turn_too_many_is_an_outlier),
    cmocka_unit_test(a_joint_that_became_another_opens_the_gate),
    cmocka_unit_test(errors_do_not_depend_on_a_bad_start),
    cmocka_unit_test(a_step_of_one_and_of_two_ticks_is_taken),
    cmocka_unit_test(without_motion_nothing_is_published),
    cmocka_unit_test(after_garbage_the_truth_is_found),
    cmocka_unit_test(what_is_out_of_range_is_refused_by_its_status),
    cmocka_unit_test(before_init_nothing_is_done),
};
RUN(tests)
