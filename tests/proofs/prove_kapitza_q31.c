/* The strong form's rows from any derivatives within their limits in any formats, and the innovation
 * of any row at any p. */
#include "prove.h"

#include "pvid/kapitza_strong_q31.h"

/* Its branch by the upper word is shown in integer_q31: the bound of the result is a relation between two words. */
/*@ requires -0x4000000000000000 <= product <= 0x4000000000000000;
    requires \initialized(out) && *out == 0;
    assigns \result, *out \from *self, a, product;
    ensures \result == 0 || \result == 1;
    ensures \initialized(out) && -0x20000000 <= *out <= 0x1FFFFFFF; */
static bool term(const pvid_kapitza_estimator_q31 *self, size_t a, int64_t product, int32_t *out);

#include "kapitza_row_q31.c"

static int8_t any_shift(void)
{
    return (int8_t)any_i32(-31, 31);
}

static void any_row(void)
{
    pvid_strong_row_q31 format = {.phi3 = any_i32(1, INT32_MAX), .reference = any_i32(0, PVID_KAPITZA_RATE_LIMIT_Q31)};
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        format.phi_shift[k] = any_shift();
    }
    format.finer[0] = any_shift();
    format.finer[1] = any_shift();
    int32_t phi[PVID_ORDERS];
    int32_t u[PVID_Y_ORDERS_Q31];
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        phi[k] = any_i32(-PVID_DERIVATIVE_LIMIT_Q31, PVID_DERIVATIVE_LIMIT_Q31);
    }
    u[0] = any_i32(-PVID_KAPITZA_RATE_LIMIT_Q31, PVID_KAPITZA_RATE_LIMIT_Q31);
    u[1] = any_i32(-PVID_DERIVATIVE_LIMIT_Q31, PVID_DERIVATIVE_LIMIT_Q31);
    u[2] = any_i32(-PVID_DERIVATIVE_LIMIT_Q31, PVID_DERIVATIVE_LIMIT_Q31);
    int32_t row[PVID_KAPITZA_ROW_Q31];
    (void)pvid_kapitza_strong_row_q31(&format, phi, u, row);
}

static void any_innovation(void)
{
    static pvid_kapitza_estimator_q31 estimator;
    int32_t row[PVID_KAPITZA_ROW_Q31];
    int32_t gradient[PVID_KAPITZA_P];
    int32_t e;
    for (size_t i = 0; i < PVID_KAPITZA_ROW_G; i++) {
        row[i] = any_i32(-PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31);
    }
    row[PVID_KAPITZA_ROW_G] = any_i32(-PVID_KAPITZA_RATE_LIMIT_Q31, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator.p[a] = any_i32(1, INT32_MAX);
    }
    estimator.reference = any_i32(0, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    estimator.bits[0] = (int8_t)any_i32(0, 60);
    estimator.bits[1] = (int8_t)any_i32(0, 60);
    if (pvid_kapitza_estimator_innovate_q31(&estimator, row, &e, gradient)) {
        /*@ assert -0x10000000 <= e <= 0x0FFFFFFF; */
        for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
            /*@ assert -0x40000000 <= gradient[a] <= 0x3FFFFFFF; */
        }
    }
}

void main(void)
{
    any_row();
    any_innovation();
}
