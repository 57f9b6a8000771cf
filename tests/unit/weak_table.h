/* A small weak-form design made at run time, in double: five taps, polynomials (1 - x^2)^6 x^k, made
 * orthonormal at a nominal p. For tests of the core; real designs come from pvid.design.weak. */
#ifndef WEAK_TABLE_H
#define WEAK_TABLE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "pvid/weak.h"

#define TABLE_DECIMATION 8
#define TABLE_WINDOW 157
#define TABLE_FUNCTIONS 6
#define TABLE_PAIRS ((TABLE_FUNCTIONS * (TABLE_FUNCTIONS + 1)) / 2)
#define TABLE_RATE 1000.0
#define TABLE_DEGREE 17 /* of (1 - x^2)^6 x^5 */

static const double table_nominal[3] = {32.0, 9.0, 6.0};

static float table_smooth[2] = {0.0f, 0.0f};
static float table_second[2] = {16.0f / 12.0f, -1.0f / 12.0f};
static float table_chi[TABLE_WINDOW * 3 * TABLE_FUNCTIONS];
static float table_gram[6 * TABLE_PAIRS];

static pvid_weak_design_f32 table_design = {
    .taps = 5,
    .decimation = TABLE_DECIMATION,
    .window = TABLE_WINDOW,
    .functions = TABLE_FUNCTIONS,
    .smooth = table_smooth,
    .second = table_second,
    .chi = table_chi,
    .gram = table_gram,
    .overlap = 1.5f,
    .lag = 8,
};

static double table_double[3][TABLE_FUNCTIONS][TABLE_WINDOW]; /* chi, chi'', chi'''' */

/* The derivative of the given order of x^k (1 - x^2)^6 at x. */
static double table_function(int k, int order, double x)
{
    static const double binomial[7] = {1, -6, 15, -20, 15, -6, 1};
    double sum = 0.0;
    for (int j = 0; j <= 6; j++) {
        const int power = k + (2 * j);
        double factor = binomial[j];
        for (int i = 0; i < order; i++) {
            factor *= power - i;
        }
        sum += (power >= order) ? factor * pow(x, power - order) : 0.0;
    }
    return sum;
}

static double table_residual(size_t k, size_t i)
{
    const double two = table_nominal[1] * table_nominal[0];
    const double zero = table_nominal[2] * table_nominal[0] * table_nominal[0];
    return table_double[2][k][i] + (two * table_double[1][k][i]) + (zero * table_double[0][k][i]);
}

static double table_product(size_t a, size_t b)
{
    double sum = 0.0;
    for (size_t i = 0; i < TABLE_WINDOW; i++) {
        sum += table_residual(a, i) * table_residual(b, i);
    }
    return sum;
}

static void table_scale(size_t k, double by, size_t from)
{
    for (size_t d = 0; d < 3; d++) {
        for (size_t i = 0; i < TABLE_WINDOW; i++) {
            table_double[d][k][i] =
                (from == k) ? (table_double[d][k][i] * by) : (table_double[d][k][i] - (by * table_double[d][from][i]));
        }
    }
}

static void make_table(void)
{
    static const size_t pair[6][2] = {{2, 2}, {2, 1}, {2, 0}, {1, 1}, {1, 0}, {0, 0}};
    const double half = 0.5 * (TABLE_WINDOW - 1) * TABLE_DECIMATION / TABLE_RATE; /* of the window [s] */
    for (size_t d = 0; d < 3; d++) {
        for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
            for (size_t i = 0; i < TABLE_WINDOW; i++) {
                const double x = ((2.0 * (double)i) / (TABLE_WINDOW - 1)) - 1.0;
                table_double[d][k][i] = table_function((int)k, 2 * (int)d, x) / pow(half, 2.0 * (double)d);
            }
        }
    }
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) { /* Gram-Schmidt, twice, on the residual filters */
        for (int pass = 0; pass < 2; pass++) {
            for (size_t j = 0; j < k; j++) {
                table_scale(k, table_product(k, j), j);
            }
            table_scale(k, 1.0 / sqrt(table_product(k, k)), k);
        }
    }
    for (size_t i = 0; i < TABLE_WINDOW; i++) {
        for (size_t d = 0; d < 3; d++) {
            for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
                table_chi[(((i * 3) + d) * TABLE_FUNCTIONS) + k] = (float)table_double[d][k][i];
            }
        }
    }
    for (size_t g = 0; g < 6; g++) {
        for (size_t a = 0; a < TABLE_FUNCTIONS; a++) {
            for (size_t b = 0; b <= a; b++) {
                double sum = 0.0;
                for (size_t i = 0; i < TABLE_WINDOW; i++) {
                    const double one = table_double[pair[g][0]][a][i] * table_double[pair[g][1]][b][i];
                    const double other = table_double[pair[g][1]][a][i] * table_double[pair[g][0]][b][i];
                    sum += (pair[g][0] == pair[g][1]) ? one : (one + other);
                }
                table_gram[(g * TABLE_PAIRS) + ((a * (a + 1)) / 2) + b] = (float)sum;
            }
        }
    }
}

/* The weak form with this table, from start [w, d1, d2, c], half of which is its standard deviation. */
static inline pvid_weak_config_f32 table_config(const float start[4])
{
    pvid_weak_config_f32 config = {
        .sample_rate_hz = (float)TABLE_RATE,
        .l1 = 0.3f,
        .design = &table_design,
        .zero_unknown = true,
        .iterations = 3,
        .estimator = pvid_estimator_defaults_f32,
        .trust = pvid_trust_defaults_f32,
    };
    for (int i = 0; i < 4; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = (i < 3) ? (0.5f * start[i]) : 0.5f;
        config.estimator.lower[i] = (i < 3) ? (0.05f * start[i]) : -1.0f;
        config.estimator.upper[i] = (i < 3) ? (20.0f * start[i]) : 1.0f;
    }
    config.estimator.row_sd = 1.0e-4f;
    return config;
}

#endif
