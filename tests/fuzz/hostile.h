/* Random numbers, hostile values and samples for the fuzzer of the public API; the same from the same seed. */
#ifndef HOSTILE_H
#define HOSTILE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

static uint64_t hostile_state;

static inline uint64_t hostile_random(void)
{
    hostile_state ^= hostile_state << 13;
    hostile_state ^= hostile_state >> 7;
    hostile_state ^= hostile_state << 17;
    return hostile_state;
}

static inline void hostile_seed(uint64_t seed)
{
    hostile_state = (seed * 0x9E3779B97F4A7C15u) | 1u;
    for (int i = 0; i < 10; i++) {
        (void)hostile_random();
    }
}

/* 0..n-1 */
static inline uint32_t below(uint32_t n)
{
    return (uint32_t)(hostile_random() >> 33) % n;
}

static inline bool one_in(uint32_t n)
{
    return below(n) == 0u;
}

static inline uint32_t any_word(void)
{
    return (uint32_t)(hostile_random() >> 32);
}

static inline int32_t any_i32(void)
{
    const uint32_t word = any_word();
    int32_t value;
    memcpy(&value, &word, sizeof value);
    return value;
}

/* Any magnitude, none more likely than another. */
static inline int32_t any_size_i32(void)
{
    return one_in(2) ? any_i32() : (int32_t)((any_word() >> 1) >> below(31));
}

/* 0..1 */
static inline float any_part(void)
{
    return (float)((double)(hostile_random() >> 11) / 9007199254740992.0);
}

/* Any 32 bits: NaN, infinities and subnormals among them. */
static inline float any_float(void)
{
    const uint32_t word = any_word();
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static inline float hostile_float(void)
{
    static const float edges[] = {0.0f,  -0.0f, 1.0f, -1.0f, 1.0e-45f, 1.17549435e-38f, 3.4e38f,   -3.4e38f,
                                  1e-6f, 1e6f,  0.9f, 1e19f, 1e-19f,   65504.0f,        16777216.f};
    switch (below(5)) {
    case 0:
        return any_float();
    case 1:
        return edges[below((uint32_t)(sizeof edges / sizeof edges[0]))];
    case 2:
        return one_in(2) ? NAN : (one_in(2) ? INFINITY : -INFINITY);
    case 3:
        return (any_part() - 0.5f) * 2.0f;
    default:
        return powf(10.0f, (any_part() - 0.5f) * 20.0f) * (one_in(2) ? 1.0f : -1.0f);
    }
}

#define HOSTILE_SIGNALS 12u

/* A sample of one kind of garbage, from any bits to a plausible lie: phi [rad], y [m]. */
static inline void hostile_sample(uint32_t kind, unsigned long tick, float *phi, float *y)
{
    static float slow;
    static float fast;
    const float t = (float)tick * 0.001f;
    switch (kind) {
    case 0:
        *phi = any_float();
        *y = any_float();
        break;
    case 1:
        *phi = hostile_float();
        *y = hostile_float();
        break;
    case 2: /* white noise */
        *phi = (any_part() - 0.5f) * 0.2f;
        *y = (any_part() - 0.5f) * 0.01f;
        break;
    case 3: /* tones that have nothing to do with each other */
        *phi = 0.05f * sinf(14.0f * t);
        *y = 0.005f * sinf(14.45f * t);
        break;
    case 4: /* a stuck encoder */
        *phi = 0.0f;
        *y = 0.005f * sinf(14.45f * t);
        break;
    case 5:
        *phi = (0.05f * sinf(14.0f * t)) + (0.0001f * (any_part() - 0.5f));
        *y = 0.005f * (any_part() - 0.5f);
        break;
    case 6: /* squares */
        *phi = (float)((tick / 200u) % 2u) * 0.1f;
        *y = (float)((tick / 170u) % 2u) * 0.005f;
        break;
    case 7: /* a plausible lie */
        *phi = (0.05f * sinf(14.0f * t)) + (0.03f * sinf((36.0f * t) + 1.0f));
        *y = (0.005f * sinf(14.45f * t)) + (0.003f * sinf(30.0f * t));
        break;
    case 8:
        *phi = 1.0e-30f * any_float();
        *y = one_in(100) ? NAN : (0.005f * sinf(14.45f * t));
        break;
    case 9:
        *phi = (0.05f * expf(-0.05f * t) * sinf(5.0f * t)) + (0.001f * any_part());
        *y = (0.004f * sinf(3.0f * t)) + (0.003f * sinf(20.0f * t));
        break;
    case 10: /* chirps */
        *phi = 0.1f * sinf(0.5f * t * t);
        *y = 0.005f * sinf(0.7f * t * t);
        break;
    default: /* coloured noise */
        slow = (0.999f * slow) + (0.002f * (any_part() - 0.5f));
        fast = (0.99f * fast) + (0.0005f * (any_part() - 0.5f));
        *phi = slow;
        *y = fast;
        break;
    }
}

/* A count of a sensor with that full scale. */
static inline int32_t hostile_count(int32_t full_scale)
{
    switch (below(5)) {
    case 0:
        return any_i32();
    case 1:
        return one_in(2) ? INT32_MAX : INT32_MIN;
    case 2:
        return 0;
    default:
        return (int32_t)below(((uint32_t)full_scale * 2u) + 1u) - full_scale;
    }
}

static inline int32_t count_of(float value, double lsb)
{
    const double counts = (double)value / lsb;
    return (isfinite(counts) && (fabs(counts) < 2.0e9)) ? (int32_t)counts : ((value < 0.0f) ? INT32_MIN : INT32_MAX);
}

/* The same in counts; lsb of phi [rad] and of y [m]. */
static inline void hostile_counts(uint32_t kind, unsigned long tick, const double lsb[2], const int32_t full_scale[2],
                                  int32_t *phi, int32_t *y)
{
    if (kind < 2u) {
        *phi = hostile_count(full_scale[0]);
        *y = hostile_count(full_scale[1]);
        return;
    }
    float angle;
    float height;
    hostile_sample(kind, tick, &angle, &height);
    *phi = count_of(angle, lsb[0]);
    *y = count_of(height, lsb[1]);
}

#endif
