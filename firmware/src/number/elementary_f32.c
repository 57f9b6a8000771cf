#include "number/uncontracted.h"

#include "pvid/elementary.h"

#include <stdbool.h>
#include <stdint.h>

#include "number/finite_f32.h"

#define INVERSE_PI 0.318309886f

/* pi in three parts of 8, 11 and 24 bits: k of the first two is exact for |k| up to 2^13. */
#define PI_HIGH 3.140625f
#define PI_MIDDLE 9.67502594e-04f
#define PI_LOW 1.50995803e-07f

/* Adding and subtracting 1.5 2^23 rounds |x| < 2^22 to the nearest integer. */
static inline float nearest(float x)
{
    const float magic = 12582912.0f;
    return (x + magic) - magic;
}

static inline bool is_odd(float integer)
{
    return ((uint32_t)(int32_t)integer & 1u) != 0u;
}

static inline bool is_angle(float x)
{
    return (x >= -PVID_ANGLE_LIMIT_F32) && (x <= PVID_ANGLE_LIMIT_F32);
}

static inline float not_a_number(void)
{
    return pvid_from_bits_f32(0x7FC00000u);
}

/* x - turns pi */
static inline float reduced(float x, float turns)
{
    return ((x - (turns * PI_HIGH)) - (turns * PI_MIDDLE)) - (turns * PI_LOW);
}

/* sin r, |r| <= pi / 2: the polynomial of least greatest error, 5e-9. */
static inline float sine_of_reduced(float r)
{
    const float z = r * r;
    float p = 2.5999791e-06f;
    p = (p * z) - 1.98065813e-04f;
    p = (p * z) + 8.33301712e-03f;
    p = (p * z) - 1.66666567e-01f;
    return r + ((r * z) * p);
}

float pvid_sin_f32(float x)
{
    if (!is_angle(x)) {
        return not_a_number();
    }
    const float turns = nearest(x * INVERSE_PI);
    const float sine = sine_of_reduced(reduced(x, turns));
    return is_odd(turns) ? -sine : sine;
}

/* cos(r + (k + 1/2) pi) = -(-1)^k sin r */
float pvid_cos_f32(float x)
{
    if (!is_angle(x)) {
        return not_a_number();
    }
    const float turns = nearest((x * INVERSE_PI) - 0.5f);
    const float sine = sine_of_reduced(reduced(x, turns + 0.5f));
    return is_odd(turns) ? sine : -sine;
}

float pvid_sign_f32(float v)
{
    if (v > 0.0f) {
        return 1.0f;
    }
    return (v < 0.0f) ? -1.0f : 0.0f;
}

float pvid_magnitude_f32(float x)
{
    return (x < 0.0f) ? -x : x;
}

float pvid_soft_sign_f32(float v, float width)
{
    return v / (pvid_magnitude_f32(v) + width);
}

/* 1 - tanh 7 is 1.7e-6. */
#define TANH_END 7.0f

float pvid_tanh_f32(float x)
{
    if ((x > TANH_END) || (x < -TANH_END)) {
        return (x > 0.0f) ? 1.0f : -1.0f;
    }
    const float z = x * x;
    float above = 3.99569171e-06f;
    above = (above * z) + 2.29304517e-03f;
    above = (above * z) + 1.23220012e-01f;
    above = (above * z) + 9.99998987e-01f;
    float below = 1.43980025e-04f;
    below = (below * z) + 2.11513992e-02f;
    below = (below * z) + 4.56545591e-01f;
    below = (below * z) + 1.0f;
    return (x * above) / below;
}
