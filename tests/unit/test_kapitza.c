/* The strong form in float32 against theory.md's formulas written out in double. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "kapitza_estimator_f32.h"
#include "kapitza_row_f32.h"
#include "kapitza_sums_f32.h"
#include "pvid/pvid.h"

#define ROWS 64
#define N 11

static uint32_t generator = 3u;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

static float phi[ROWS][5], u[ROWS][3], rows[ROWS][N], values[ROWS];
static pvid_strong_row_f32 factors[ROWS];

static int make_rows(void **state)
{
    static const float phi_size[5] = {0.1f, 1.0f, 24.0f, 300.0f, 13000.0f};
    static const float u_size[3] = {8.0f, 150.0f, 3000.0f};
    (void)state;
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k < 5; k++) {
            phi[i][k] = phi_size[k] * noise();
        }
        for (int k = 0; k < 3; k++) {
            u[i][k] = u_size[k] * noise();
        }
        pvid_kapitza_strong_row_f32(phi[i], u[i], &values[i], rows[i]);
        pvid_kapitza_row_f32(phi[i], u[i], &factors[i]);
    }
    return 0;
}

static const float p[3] = {31.7f, 8.9f, 5.6f};

/* N of theory.md 2, its theta, and C by columns. */
static void paper_row(int i, double n[N], double *y)
{
    const double z0 = (double)phi[i][0], z2 = (double)phi[i][2], z3 = (double)phi[i][3], z4 = (double)phi[i][4];
    const double a = (double)u[i][0], b = (double)u[i][1], c = (double)u[i][2];
    *y = (a * a * z4) - (2.0 * a * b * z3) + (((2.0 * b * b) - (a * c)) * z2);
    const double row[N] = {
        (-2.0 * a * z4) + (2.0 * b * z3) + (c * z2),
        -z4,
        -a * a * a * z2,
        -3.0 * a * a * z2,
        -3.0 * a * z2,
        -z2,
        -a * a * a * a * z0,
        -4.0 * a * a * a * z0,
        -6.0 * a * a * z0,
        -4.0 * a * z0,
        -z0,
    };
    memcpy(n, row, sizeof row);
}

static void paper_theta(double theta[N])
{
    const double w = (double)p[0], d1 = (double)p[1], d2 = (double)p[2];
    const double t[N] = {w,  w * w,  d1,         d1 * w,         d1 * w * w,        d1 * w * w * w,
                         d2, d2 * w, d2 * w * w, d2 * w * w * w, d2 * w * w * w * w};
    memcpy(theta, t, sizeof t);
}

static void paper_c(double c[N][3])
{
    const double w = (double)p[0], d1 = (double)p[1], d2 = (double)p[2];
    const double first[N] = {
        1, 2 * w, 0, d1, 2 * d1 * w, 3 * d1 * w * w, 0, d2, 2 * d2 * w, 3 * d2 * w * w, 4 * d2 * w * w * w};
    const double powers[5] = {1, w, w * w, w * w * w, w * w * w * w};
    for (int i = 0; i < N; i++) {
        c[i][0] = first[i];
        c[i][1] = ((i >= 2) && (i < 6)) ? powers[i - 2] : 0.0;
        c[i][2] = (i >= 6) ? powers[i - 6] : 0.0;
    }
}

static void close_to(double got, double expected, double largest, double relative)
{
    assert_true(fabs(got - expected) <= relative * largest);
}

static void row_times_theta_is_the_papers(void **state)
{
    (void)state;
    static const double binomial[N] = {1, 1, 1, 3, 3, 1, 1, 4, 6, 4, 1}; /* in theta instead of N */
    double t[N];
    paper_theta(t);
    for (int i = 0; i < ROWS; i++) {
        double n[N];
        double y;
        double largest = 0.0;
        paper_row(i, n, &y);
        for (int k = 0; k < N; k++) {
            const double term = fabs(n[k] * t[k]);
            largest = (term > largest) ? term : largest;
        }
        for (int k = 0; k < N; k++) { /* each product: at most 12 roundings on its way */
            close_to((double)rows[i][k] * (binomial[k] * t[k]), n[k] * t[k], largest, 12.0 * 0x1p-24);
        }
        close_to((double)values[i], y, fabs(y) + 1.0e6, 12.0 * 0x1p-24);
    }
}

static void projection_by_shifts_is_the_dense_product(void **state)
{
    (void)state;
    static pvid_strong_estimator_f32 estimator; /* all zeros */
    memcpy(estimator.p, p, sizeof p);
    double m[N][N] = {{0.0}}, m_abs[N][N] = {{0.0}}, b[N] = {0.0}, b_abs[N] = {0.0}, t[N], c[N][3];
    double yy = 0.0;
    for (int r = 0; r < ROWS - 1; r++) {
        double n[N];
        double y;
        if (r < ROWS - 4) {
            if ((r % PVID_STRONG_ROWS) == (PVID_STRONG_ROWS - 1)) {
                pvid_kapitza_add_rows_f32(estimator.block, &factors[r], estimator.sums.low);
            } else {
                estimator.block[r % PVID_STRONG_ROWS] = factors[r];
            }
        }
        paper_row(r, n, &y);
        yy += y * y;
        for (int i = 0; i < N; i++) {
            b[i] += n[i] * y;
            b_abs[i] += fabs(n[i] * y);
            for (int j = 0; j < N; j++) {
                m[i][j] += n[i] * n[j];
                m_abs[i][j] += fabs(n[i] * n[j]);
            }
        }
    }
    for (int r = ROWS - 4; r < ROWS - 1; r++) { /* three rows wait in their block; the last of all is left out */
        estimator.block[r - (ROWS - 4)] = factors[r];
    }
    estimator.in_block = 3;
    float packed[6];
    float f[PVID_KAPITZA_P];
    pvid_kapitza_residual_f32 residual;
    pvid_kapitza_gather_residuals_f32(&estimator, packed, f, &residual);
    assert_float_equal(residual.weight, ROWS - 1, 0.0f);
    const float s[3][3] = {{packed[0], packed[1], packed[2]}, {0.0f, packed[3], packed[4]}, {0.0f, 0.0f, packed[5]}};
    paper_theta(t);
    paper_c(c);
    /* ROWS additions, about 30 more roundings to the end: 100 ulp of the sum of absolute terms */
    const double relative = 100.0 * 0x1p-24;
    double expected = yy, all_terms = yy;
    for (int i = 0; i < N; i++) {
        expected -= 2.0 * t[i] * b[i];
        all_terms += 2.0 * t[i] * b_abs[i];
        for (int j = 0; j < N; j++) {
            expected += t[i] * m[i][j] * t[j];
            all_terms += t[i] * m_abs[i][j] * t[j];
        }
    }
    close_to((double)residual.rss, expected, all_terms, relative);
    for (int a = 0; a < 3; a++) {
        double force = 0.0, largest = 0.0;
        for (int i = 0; i < N; i++) {
            force += c[i][a] * b[i];
            largest += c[i][a] * b_abs[i];
            for (int j = 0; j < N; j++) {
                force -= c[i][a] * m[i][j] * t[j];
                largest += c[i][a] * m_abs[i][j] * t[j];
            }
        }
        close_to((double)f[a], force, largest, relative);
        for (int d = a; d < 3; d++) {
            double entry = 0.0, entry_abs = 0.0;
            for (int i = 0; i < N; i++) {
                for (int j = 0; j < N; j++) {
                    entry += c[i][a] * m[i][j] * c[j][d];
                    entry_abs += c[i][a] * m_abs[i][j] * c[j][d];
                }
            }
            close_to((double)s[a][d], entry, entry_abs, relative);
        }
    }
}

static void innovation_is_the_residual_and_its_gradient(void **state)
{
    (void)state;
    double t[N], c[N][3];
    paper_theta(t);
    paper_c(c);
    for (int r = 0; r < ROWS; r++) {
        double n[N];
        double y;
        float gradient[3];
        paper_row(r, n, &y);
        const float e = pvid_kapitza_innovate_f32(p, &factors[r], gradient);
        double expected = y, largest = fabs(y);
        for (int i = 0; i < N; i++) {
            expected -= n[i] * t[i];
            largest += fabs(n[i] * t[i]);
        }
        close_to((double)e, expected, largest, 40.0 * 0x1p-24); /* about 20 roundings of terms that size, twice over */
        for (int a = 0; a < 3; a++) {
            double slope = 0.0, slope_abs = 0.0;
            for (int i = 0; i < N; i++) {
                slope += n[i] * c[i][a];
                slope_abs += fabs(n[i] * c[i][a]);
            }
            close_to((double)gradient[a], slope, slope_abs, 40.0 * 0x1p-24);
        }
    }
}

static void physical_parameters_come_back(void **state)
{
    (void)state;
    const pvid_kapitza_f32 truth = {.g = 9.5f, .l2 = 0.12f, .rho2 = 0.08f};
    pvid_estimate_f32 estimate;
    memset(&estimate, 0, sizeof estimate);
    pvid_kapitza_linear_f32(&truth, 0.3f, estimate.p);
    assert_float_equal(estimate.p[0], 31.666667f, 1.0e-5f); /* theory.md 6; a few ulp */
    assert_float_equal(estimate.p[1], 8.875f, 5.0e-6f);
    assert_float_equal(estimate.p[2], 5.625f, 5.0e-6f);
    estimate.covariance[0][0] = 1.0e-4f;
    estimate.covariance[1][1] = 4.0e-4f;
    estimate.covariance[2][2] = 9.0e-4f;
    estimate.covariance[1][2] = 3.0e-4f;
    estimate.covariance[2][1] = 3.0e-4f;
    pvid_kapitza_f32 value;
    pvid_kapitza_f32 se;
    assert_true(pvid_kapitza_physical_f32(&estimate, 0.3f, &value, &se));
    assert_float_equal(value.g, truth.g, 1.0e-5f);
    assert_float_equal(value.l2, truth.l2, 1.0e-6f); /* L2 = d1 - d2 - 1 loses two bits */
    assert_float_equal(value.rho2, truth.rho2, 1.0e-6f);
    /* l2 = l1 L2 / d2: gradient (l1 / d2, -(l1 + l2) / d2); rho2 = l1 sqrt(L2) / d2 likewise */
    const double a = 0.3 / 5.625, b = -(0.3 + 0.12) / 5.625;
    assert_float_equal(se.g, 0.003f, 1.0e-7f);
    assert_float_equal(se.l2, (float)sqrt((a * a * 4e-4) + (b * b * 9e-4) + (2 * a * b * 3e-4)), 1.0e-7f);
    const double c = 0.3 / (2 * 1.5 * 5.625), d = -c - (0.08 / 5.625);
    assert_float_equal(se.rho2, (float)sqrt((c * c * 4e-4) + (d * d * 9e-4) + (2 * c * d * 3e-4)), 1.0e-7f);
}

static void outside_the_physical_region_nothing_is_written(void **state)
{
    (void)state;
    const float infinity = 3.4e38f * 10.0f;
    const float bad[5][3] = {{-1.0f, 9.0f, 5.0f},
                             {30.0f, 5.0f, 5.0f},
                             {30.0f, 9.0f, -1.0f},
                             {30.0f, infinity, 5.0f},
                             {infinity - infinity, 9.0f, 5.0f}};
    for (int i = 0; i < 5; i++) {
        pvid_estimate_f32 estimate;
        memset(&estimate, 0, sizeof estimate);
        memcpy(estimate.p, bad[i], sizeof bad[i]);
        pvid_kapitza_f32 value = {1.0f, 2.0f, 3.0f};
        const pvid_kapitza_f32 before = value;
        pvid_kapitza_f32 se = value;
        assert_false(pvid_kapitza_physical_f32(&estimate, 0.3f, &value, &se));
        assert_memory_equal(&value, &before, sizeof value);
        assert_memory_equal(&se, &before, sizeof se);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(row_times_theta_is_the_papers),
        cmocka_unit_test(projection_by_shifts_is_the_dense_product),
        cmocka_unit_test(innovation_is_the_residual_and_its_gradient),
        cmocka_unit_test(physical_parameters_come_back),
        cmocka_unit_test(outside_the_physical_region_nothing_is_written),
    };
    return cmocka_run_group_tests(tests, make_rows, NULL);
}
