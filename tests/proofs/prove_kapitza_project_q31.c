/* The normal equations of the strong form: any sums, any p, any formats that init takes, near the reference and far
 * from it. That the mantissas of a family fit 28 bits, or 53, is the choice of its scale and Cauchy-Schwarz: contracts
 * here, tested with hostile rows. */
#include "prove.h"

#include "contracts.h"
#include "kapitza_sums_q31.h"

/*@ assigns m[0 .. 56] \from sums[0 .. 56], *scales;
    ensures \initialized(m + (0 .. 56));
    ensures \subset(m[0 .. 56], (-0x10000000 .. 0x10000000)); */
static void take_mantissas(const int64_t sums[], const pvid_kapitza_system_q31 *scales, int32_t m[]);

/*@ requires 0 <= t <= 6;
    assigns m[0 .. 56], scales->scale_a, scales->scale_x, scales->scale_z \from sums[0 .. 56], t;
    ensures \initialized(m + (0 .. 56));
    ensures \subset(m[0 .. 56], (-0x20000000000000 .. 0x20000000000000));
    ensures \initialized(&scales->scale_a) && \initialized(&scales->scale_x) && \initialized(&scales->scale_z);
    ensures -60 <= scales->scale_a <= 10 && -60 <= scales->scale_x <= 10 && -60 <= scales->scale_z <= 10; */
static void take_64(const int64_t sums[], int32_t t, pvid_kapitza_system_q31 *scales, int64_t m[]);

/*@ requires 1 <= p <= 0x7FFFFFFF && 3 <= factor <= 4 && -1000 <= exponent <= 1000;
    assigns \result \from p, exponent, factor;
    ensures 0 <= \result <= 0x20000000 / factor; */
static int32_t as_part(int32_t p, int32_t exponent, int32_t factor);

#include "kapitza_project_q31.c"

static pvid_kapitza_estimator_q31 estimator;

void main(void)
{
    pvid_kapitza_system_q31 system;
    int32_t of[PVID_KAPITZA_P];
    for (size_t i = 0; i < PVID_KAPITZA_SUMS_Q31; i++) {
        estimator.sums[i] = any_i64(-((int64_t)1 << 61), (int64_t)1 << 61);
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator.p[a] = any_i32(1, INT32_MAX);
    }
    estimator.reference = any_i32(0, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    estimator.bits[0] = (int8_t)any_i32(0, 60);
    estimator.bits[1] = (int8_t)any_i32(0, 60);
    pvid_kapitza_project_q31(&estimator, &system);
    pvid_kapitza_exponents_q31(&estimator, &system, of);
    for (size_t i = 0; i < 6u; i++) {
        /*@ assert -0x100000000 <= system.s[i] <= 0x100000000; */
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        /*@ assert -0x2000000000000000 <= system.f[a] <= 0x2000000000000000; */
        /*@ assert -400 <= of[a] <= 400; */
    }
}
