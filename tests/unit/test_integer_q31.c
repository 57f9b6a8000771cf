/* Integer arithmetic against what a wider type or a closed form says. */
#include "test.h"

#include "solve/cholesky_q31.h"
#include "number/integer_q31.h"

/* A generator of its own: the same numbers on every machine. */
static uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

/* A number of random size within +-PVID_WIDE. */
static int64_t random_wide(uint64_t *state)
{
    const uint64_t magnitude = (next_random(state) >> 2) >> (next_random(state) % 62u);
    return ((next_random(state) & 1u) != 0u) ? -(int64_t)magnitude : (int64_t)magnitude;
}

/* floor(x / 2^s + 1/2) without a shift of a negative number. */
static int64_t rounded(int64_t x, uint32_t s)
{
    const int64_t divisor = (int64_t)1 << s;
    const int64_t rest = ((x % divisor) + divisor) % divisor;
    return ((x - rest) / divisor) + (((2 * rest) >= divisor) ? 1 : 0);
}

static void a_shift_right_rounds_half_up(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_round_shift_q31(3, 1), 2);
    assert_int_equal(pvid_round_shift_q31(-3, 1), -1);
    assert_int_equal(pvid_round_shift_q31(-5, 0), -5);
    assert_int_equal(pvid_round_shift_q31(PVID_WIDE, 63), 1);
    assert_int_equal(pvid_round_shift_q31(-PVID_WIDE, 63), 0);
    assert_int_equal(pvid_round_shift_q31(-PVID_WIDE, 64), 0);
    assert_int_equal(pvid_round_shift_q31(INT64_MAX - 1, 1), ((int64_t)1 << 62) - 1); /* the largest allowed */
    uint64_t state = 1;
    for (int i = 0; i < 20000; i++) {
        const int64_t x = random_wide(&state);
        const uint32_t s = 1u + (uint32_t)(next_random(&state) % 60u);
        assert_int_equal(pvid_round_shift_q31(x, s), rounded(x, s));
        assert_int_equal(pvid_scale_q31(x, (int32_t)s), rounded(x, s));
    }
}

static void a_shift_left_saturates(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_scale_q31(3, -4), 48);
    assert_int_equal(pvid_scale_q31(-3, -4), -48);
    assert_int_equal(pvid_scale_q31(0, -500), 0);
    assert_int_equal(pvid_scale_q31(1, -61), (int64_t)1 << 61);
    assert_int_equal(pvid_scale_q31(1, -62), PVID_WIDE);
    assert_int_equal(pvid_scale_q31(-1, -500), -PVID_WIDE);
    assert_int_equal(pvid_clamp_q31(-7, 5), -5);
    assert_int_equal(pvid_clamp_q31(7, 5), 5);
    assert_int_equal(pvid_clamp_q31(4, 5), 4);
}

static void a_quotient_in_halves_is_the_quotient(void **unused)
{
    (void)unused;
    static const uint32_t edges[] = {1,       2,          3,          0x7FFF,     0x8000,     0xFFFF,    0x10000,
                                     0x10001, 0x7FFFFFFF, 0x80000000, 0x8000FFFF, 0xFFFF0000, 0xFFFFFFFF};
    const size_t n = sizeof edges / sizeof edges[0];
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            const uint32_t y = edges[i];
            const uint64_t most = ((uint64_t)(y - 1u) << 32) | 0xFFFFFFFFu; /* the largest quotient */
            const uint64_t x = most - (most % edges[j]) / 2u;
            assert_int_equal(pvid_quotient_in_halves_q31(x, y), x / y);
            assert_int_equal(pvid_quotient_in_halves_q31(edges[j], y), edges[j] / y);
            assert_int_equal(pvid_quotient_q31(x, y), x / y);
        }
    }
    uint64_t state = 9;
    for (int i = 0; i < 200000; i++) {
        const uint32_t y = 1u + ((uint32_t)next_random(&state) >> (next_random(&state) % 31u)) / 2u;
        const uint64_t x = ((uint64_t)((uint32_t)next_random(&state) % y) << 32) | (uint32_t)next_random(&state);
        assert_int_equal(pvid_quotient_in_halves_q31(x, y), x / y);
    }
}

static void a_byte_has_its_length(void **unused)
{
    (void)unused;
    for (uint32_t x = 0; x < 256u; x++) {
        assert_int_equal(pvid_byte_length_q31(x), pvid_bit_length_q31(x));
    }
}

static void an_upper_product_is_the_floor_of_the_product(void **unused)
{
    (void)unused;
    uint64_t state = 11;
    assert_int_equal(pvid_upper_product_q31(-1, 1), -1);
    assert_int_equal(pvid_upper_product_q31(INT32_MIN, INT32_MIN), (int64_t)1 << 30);
    for (int i = 0; i < 20000; i++) {
        const int32_t a = (int32_t)(next_random(&state) >> 33) - (int32_t)(next_random(&state) >> 33);
        const int32_t b = (int32_t)(next_random(&state) >> 33) - (int32_t)(next_random(&state) >> 33);
        const int64_t product = (int64_t)a * b;
        const int64_t rest = ((product % ((int64_t)1 << 32)) + ((int64_t)1 << 32)) % ((int64_t)1 << 32);
        assert_int_equal(pvid_upper_product_q31(a, b), (product - rest) / ((int64_t)1 << 32));
    }
}

static void a_product_in_halves_is_the_product(void **unused)
{
    (void)unused;
    static const int32_t edges[] = {0,      1,      -1,        32767,     32768,      65535,      65536,
                                    -32768, -65536, INT32_MAX, INT32_MIN, 0x7FFF0000, -0x7FFF0001};
    const size_t n = sizeof edges / sizeof edges[0];
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            assert_int_equal(pvid_product_in_halves_q31(edges[i], edges[j]), (int64_t)edges[i] * edges[j]);
        }
    }
    uint64_t state = 6;
    for (int i = 0; i < 20000; i++) {
        const int32_t a = (int32_t)(random_wide(&state) / ((int64_t)1 << 31));
        const int32_t b = (int32_t)(random_wide(&state) / ((int64_t)1 << 31));
        assert_int_equal(pvid_product_in_halves_q31(a, b), (int64_t)a * b);
    }
}

static void bits_are_counted(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_bit_length_q31(0), 0);
    for (uint32_t i = 0; i < 64u; i++) {
        assert_int_equal(pvid_bit_length_q31((uint64_t)1 << i), i + 1u);
        assert_int_equal(pvid_bit_length_q31(((uint64_t)1 << i) - 1u), i);
    }
}

static void a_root_is_the_largest_whose_square_fits(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_square_root_q31((uint64_t)PVID_WIDE), (int64_t)1 << 31);
    assert_int_equal(pvid_square_root_q31((uint64_t)PVID_WIDE - 1u), INT32_MAX);
    uint64_t state = 2;
    for (int i = 0; i < 20000; i++) {
        const uint64_t x = pvid_magnitude_q31(random_wide(&state));
        const uint64_t r = pvid_square_root_q31(x);
        assert_true(r * r <= x);
        assert_true((r + 1u) * (r + 1u) > x);
    }
}

/* r 2^e against x = m 2^exponent: r^2 within two units of its last place. */
static void a_scaled_root_keeps_thirty_bits(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_root_of_q31(0, 5).r, 0);
    uint64_t state = 3;
    for (int i = 0; i < 20000; i++) {
        const int64_t m = 1 + (int64_t)(next_random(&state) >> (4u + (next_random(&state) % 60u)));
        const pvid_root_q31 root = pvid_root_of_q31(m, 7);
        assert_true(root.r >= ((int32_t)1 << 30));
        const uint64_t square = (uint64_t)root.r * (uint64_t)root.r;
        const uint64_t above = (uint64_t)(root.r + (int64_t)1) * (uint64_t)(root.r + (int64_t)1);
        const int32_t shift = 7 - (2 * root.e); /* m 2^shift is the square */
        assert_true((shift >= 0) && (shift <= 62));
        assert_true((square <= ((uint64_t)m << shift)) && (above > ((uint64_t)m << shift)));
    }
}

static void a_product_with_a_fraction_is_exact_before_it_is_rounded(void **unused)
{
    (void)unused;
    assert_int_equal(pvid_times_q31(PVID_WIDE, INT32_MAX), PVID_WIDE - ((int64_t)1 << 31));
    assert_int_equal(pvid_times_q31(-1, (int32_t)1 << 30), 0);
    assert_int_equal(pvid_times_q31(1, (int32_t)1 << 30), 1);
    uint64_t state = 5;
    for (int i = 0; i < 20000; i++) {
        const int64_t a = random_wide(&state) / ((int64_t)1 << 31);
        const int32_t b = (int32_t)(random_wide(&state) / ((int64_t)1 << 31));
        assert_int_equal(pvid_times_q31(a, b), rounded(a * b, 31));
    }
}

/* 2 x 2 in Q30 with a closed form: S = [[1/2, r/2], [r/2, 1/2]], first pivot over diagonal 1 - r^2. */
static void first_pivot_is_its_remaining_part(void **unused)
{
    (void)unused;
    const int32_t half = PVID_ONE_Q30 / 2;
    int32_t s[PVID_MAX_P][PVID_MAX_P] = {{half, half / 2}, {0, half}};
    pvid_cholesky_q31 factor;
    assert_true(pvid_cholesky_factor_q31(&factor, 2, (const int32_t (*)[PVID_MAX_P])s));
    assert_in_range(factor.first_pivot, (PVID_ONE_Q30 / 4 * 3) - 8, (PVID_ONE_Q30 / 4 * 3) + 8);
    /* S^-1 (1, 0) = (8/3, -4/3) */
    const int64_t rhs[2] = {(int64_t)1 << 40, 0};
    int32_t x[PVID_MAX_P];
    const int32_t exponent = pvid_cholesky_solve_q31(&factor, rhs, x);
    assert_true((exponent >= 0) && (exponent < 40));
    const int64_t first = ((int64_t)x[0] * ((int64_t)1 << exponent)) / ((int64_t)1 << 20);
    const int64_t second = ((int64_t)x[1] * ((int64_t)1 << exponent)) / ((int64_t)1 << 20);
    assert_in_range(first, 2796203 - 8, 2796203 + 8); /* 8/3 2^20; a right-hand side has 20 bits */
    assert_in_range(-second, 1398101 - 8, 1398101 + 8);
    s[0][1] = half - 128; /* 1 - r^2 = 5e-7, below 2^-20 */
    assert_false(pvid_cholesky_factor_q31(&factor, 2, (const int32_t (*)[PVID_MAX_P])s));
    assert_int_equal(factor.first_pivot, 0);
    s[1][1] = 0;
    assert_false(pvid_cholesky_factor_q31(&factor, 2, (const int32_t (*)[PVID_MAX_P])s));
}

static void half_an_exponent_brings_a_diagonal_near_one(void **unused)
{
    (void)unused;
    for (int64_t x = 1; x < PVID_WIDE; x = (x * 3) + ((x < 1000) ? 1 : 0)) {
        const int64_t scaled = pvid_scale_q31(x, 2 * pvid_half_exponent_q31(x));
        assert_in_range(scaled, PVID_ONE_Q30 / 4, PVID_ONE_Q30);
        if (x > PVID_WIDE / 3) {
            break;
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_shift_right_rounds_half_up),
    cmocka_unit_test(a_shift_left_saturates),
    cmocka_unit_test(a_product_in_halves_is_the_product),
    cmocka_unit_test(a_quotient_in_halves_is_the_quotient),
    cmocka_unit_test(a_byte_has_its_length),
    cmocka_unit_test(an_upper_product_is_the_floor_of_the_product),
    cmocka_unit_test(bits_are_counted),
    cmocka_unit_test(a_root_is_the_largest_whose_square_fits),
    cmocka_unit_test(a_scaled_root_keeps_thirty_bits),
    cmocka_unit_test(a_product_with_a_fraction_is_exact_before_it_is_rounded),
    cmocka_unit_test(first_pivot_is_its_remaining_part),
    cmocka_unit_test(half_an_exponent_brings_a_diagonal_near_one),
};
RUN(tests)
