/* The weights of Adams's steps are the integrals of the polynomials that they stand for. */
#include "test.h"

#include "refine/refine_adams_f32.h"

/* Integral over 0..1 of binomial(s + k - 1, k), the weight of backward difference k, or of (1 - s) times it. */
static double weight_of(int k, int positions)
{
    double coefficient[AB + 3] = {1.0};
    for (int i = 0; i < k; i++) { /* times (s + i)/(i + 1) */
        for (int j = i + 1; j >= 0; j--) {
            const double below = (j > 0) ? coefficient[j - 1] : 0.0;
            coefficient[j] = ((i * coefficient[j]) + below) / (i + 1);
        }
    }
    double integral = 0.0;
    for (int j = 0; j <= k; j++) {
        integral += coefficient[j] * ((positions != 0) ? (1.0 / ((j + 1) * (j + 2))) : (1.0 / (j + 1)));
    }
    return integral;
}

static void test_weights_are_integrals_of_binomials(void **state)
{
    (void)job_behind_step; /* the header's other functions */
    (void)step;
    for (int k = 0; k <= (int)AB; k++) {
        assert_true(fabs(((double)of_velocity[k] / weight_of(k, 0)) - 1.0) < 1e-7);
        assert_true(fabs(((double)of_position[k] / weight_of(k, 1)) - 1.0) < 1e-7);
    }
}

/* With accelerations t^6 the predicted change is exact, and that of t^7 is once it is corrected. */
static void test_a_step_of_a_polynomial_is_exact(void **state)
{
    for (int degree = 0; degree <= 7; degree++) {
        static pvid_refine_pass_f32 pass;
        memset(&pass, 0, sizeof pass);
        pass.h = 0.5f;
        float a[N_Q];
        double t = 1.0;
        for (int k = 0; k < 9; k++) {
            for (size_t i = 0; i < N_Q; i++) {
                a[i] = (float)pow(t, degree);
            }
            renew(&pass, a, false);
            t += 0.5;
        }
        const double now = t - 0.5;
        for (size_t i = 0; i < N_Q; i++) {
            pass.state[i] = 3.0f;
            pass.state[RATES + i] = -2.0f;
        }
        predict(&pass);
        if (degree == 7) {
            for (size_t i = 0; i < N_Q; i++) {
                a[i] = (float)pow(t, degree);
            }
            renew(&pass, a, true);
        }
        const double velocity = (pow(t, degree + 1) - pow(now, degree + 1)) / (degree + 1);
        const double position = ((pow(t, degree + 2) - pow(now, degree + 2)) / ((degree + 1) * (degree + 2))) -
                                (0.5 * pow(now, degree + 1) / (degree + 1));
        for (size_t i = 0; i < N_Q; i++) { /* float32: the differences cancel */
            assert_true(fabs((double)pass.state[RATES + i] - (velocity - 2.0)) < 3e-6 * (1.0 + velocity));
            assert_true(fabs((double)pass.state[i] - (2.0 + position)) < 3e-6 * (1.0 + velocity));
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_weights_are_integrals_of_binomials),
    cmocka_unit_test(test_a_step_of_a_polynomial_is_exact),
};
RUN(tests)
