/* S and F of the fixed-point strong form against their definition in double, for p near the reference and far off. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "kapitza_places.h"
#include "kapitza_sums_q31.h"
#include "pvid/pvid_q31.h"

#define ROWS 200
#define BITS 20 /* of d1, d2 */

static pvid_kapitza_estimator_q31 estimator;
static double columns[ROWS][5]; /* A, E, -phi'', -phi, Y: integers, G in units of w */
static double rate[ROWS];

static double between(double low, double high)
{
    return low + ((high - low) * ((double)rand() / (double)RAND_MAX));
}

/* The sums of a b G^k from k on downwards. */
static void sum_powers(size_t first, size_t count, int a, int b)
{
    for (size_t i = 0; i < count; i++) {
        double sum = 0.0;
        for (int row = 0; row < ROWS; row++) {
            sum += columns[row][a] * columns[row][b] * pow(rate[row], (double)((count - 1u) - i));
        }
        estimator.sums[first + i] = (int64_t)floor(sum + 0.5);
    }
}

/* `size`: of a column with |G| < 1; two columns are dependent in part. */
static void make_rows(double size)
{
    srand(5);
    for (int row = 0; row < ROWS; row++) {
        rate[row] = between(-0.9, 0.9);
        columns[row][2] = size * between(-1.0, 1.0);
        columns[row][3] = size * between(-1.0, 1.0);
        columns[row][0] = (size * between(-1.0, 1.0)) + (0.5 * columns[row][2]);
        columns[row][1] = size * between(-1.0, 1.0);
        columns[row][4] = (size * between(-1.0, 1.0)) + (0.3 * columns[row][3]);
    }
    static const struct {
        size_t first, count;
        int a, b;
    } part[] = {
        {PVID_SUM_AA, 1, 0, 0},  {PVID_SUM_AE, 1, 0, 1},  {PVID_SUM_EE, 1, 1, 1},  {PVID_SUM_YA, 1, 4, 0},
        {PVID_SUM_YE, 1, 4, 1},  {PVID_SUM_YY, 1, 4, 4},  {PVID_SUM_A2, 4, 0, 2},  {PVID_SUM_E2, 4, 1, 2},
        {PVID_SUM_Y2, 4, 4, 2},  {PVID_SUM_A0, 5, 0, 3},  {PVID_SUM_E0, 5, 1, 3},  {PVID_SUM_Y0, 5, 4, 3},
        {PVID_SUM_K22, 7, 2, 2}, {PVID_SUM_K20, 8, 2, 3}, {PVID_SUM_K00, 9, 3, 3},
    };
    for (size_t i = 0; i < (sizeof part / sizeof part[0]); i++) {
        sum_powers(part[i].first, part[i].count, part[i].a, part[i].b);
    }
}

/* S and F of the rows at w_r + d, where N^T theta = d A + d^2 E + d1 (-phi'') (G + d)^3 + d2 (-phi) (G + d)^4. */
static void expect(double d, const double p[2], double s[6], double f[3])
{
    memset(s, 0, 6u * sizeof s[0]);
    memset(f, 0, 3u * sizeof f[0]);
    for (int row = 0; row < ROWS; row++) {
        const double *c = columns[row];
        const double g = rate[row] + d;
        const double n_1 = c[2] * pow(g, 3.0);
        const double n_2 = c[3] * pow(g, 4.0);
        const double n_w =
            c[0] + (2.0 * d * c[1]) + (3.0 * p[0] * c[2] * pow(g, 2.0)) + (4.0 * p[1] * c[3] * pow(g, 3.0));
        const double rest = c[4] - ((d * c[0]) + (d * d * c[1]) + (p[0] * n_1) + (p[1] * n_2));
        const double n[3] = {n_w, n_1, n_2};
        size_t place = 0;
        for (int a = 0; a < 3; a++) {
            f[a] += n[a] * rest;
            for (int b = a; b < 3; b++) {
                s[place] += n[a] * n[b];
                place++;
            }
        }
    }
}

static void compare(double d, const double p[2], double tolerance)
{
    memset(estimator.p, 0, sizeof estimator.p);
    estimator.reference = 3 << PVID_KAPITZA_W_BITS;
    estimator.p[0] = estimator.reference + (int32_t)(d * (double)(1 << PVID_KAPITZA_W_BITS));
    for (int i = 0; i < 2; i++) {
        estimator.bits[i] = BITS;
        estimator.p[i + 1] = (int32_t)(p[i] * (double)(1 << BITS));
    }
    pvid_kapitza_system_q31 system;
    pvid_kapitza_project_q31(&estimator, &system);
    double s[6];
    double f[3];
    expect(ldexp((double)(estimator.p[0] - estimator.reference), -PVID_KAPITZA_W_BITS), p, s, f);
    double norm_y = 0.0;
    for (int row = 0; row < ROWS; row++) {
        norm_y += columns[row][4] * columns[row][4];
    }
    const int of[3] = {system.scale_a + system.time, system.scale_x + (3 * system.time),
                       system.scale_z + (4 * system.time)};
    const int rest = system.scale_a + (2 * system.time);
    static const size_t diagonal[3] = {0, 3, 5};
    /* the terms of a residual are larger than itself */
    const double size = sqrt(norm_y) + ((fabs(d) + 1.0) * sqrt(s[0])) + (p[0] * sqrt(s[3])) + (p[1] * sqrt(s[5]));
    size_t place = 0;
    for (int a = 0; a < 3; a++) {
        const double of_f = ldexp((double)system.f[a], (of[a] + rest) - 30);
        assert_true(fabs(of_f - f[a]) < (tolerance * size * sqrt(s[diagonal[a]])));
        for (int b = a; b < 3; b++) {
            const double scale = sqrt(s[diagonal[a]] * s[diagonal[b]]);
            assert_true(fabs(ldexp((double)system.s[place], of[a] + of[b]) - s[place]) < (tolerance * scale));
            place++;
        }
    }
}

/* Multiples of 2^-BITS. */
static const double small[2] = {0.01953125, 0.0107421875};
static const double large[2] = {0.8125, 0.5};

/* Mantissas of 28 bits. */
static void near_the_reference_they_are_those_of_the_definition(void **state)
{
    (void)state;
    static const double d[] = {-0.24, -0.1, 0.0, 0.03, 0.2499};
    for (int bits = 14; bits <= 26; bits += 3) {
        make_rows(ldexp(1.0, bits));
        for (size_t i = 0; i < (sizeof d / sizeof d[0]); i++) {
            compare(d[i], small, 1.0e-6);
            compare(d[i], large, 1.0e-6);
        }
    }
}

/* A unit of time of its own for |d| beyond 1, in which the sums of small powers of G have the fewest bits. */
static void far_from_the_reference_they_are_those_of_the_definition(void **state)
{
    (void)state;
    static const double d[] = {-2.9, -1.7, -0.6, 0.26, 0.9, 1.3, 2.2, 4.9};
    for (int bits = 20; bits <= 26; bits += 3) {
        make_rows(ldexp(1.0, bits));
        for (size_t i = 0; i < (sizeof d / sizeof d[0]); i++) {
            compare(d[i], small, 1.0e-6);
            compare(d[i], large, 1.0e-6);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(near_the_reference_they_are_those_of_the_definition),
        cmocka_unit_test(far_from_the_reference_they_are_those_of_the_definition),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
