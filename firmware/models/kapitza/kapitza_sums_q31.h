/* The sums of the strong form in integers, and S and F of them. Private to the core. */
#ifndef PVID_KAPITZA_SUMS_Q31_H
#define PVID_KAPITZA_SUMS_Q31_H

#include "pvid/kapitza_strong_q31.h"

/* Adds a row, divided as the sums are. */
void pvid_kapitza_add_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31]);

/* Ends a row: forgets when it is time to, and keeps the sums of squares below 2^60. */
void pvid_kapitza_end_row_q31(pvid_kapitza_estimator_q31 *self);

/* The normal equations S dp' = F at the present p, F with 30 bits after the point. In units of
 *   w': 2^time / T^2,  d1': 2^-of_x,  d2': 2^-of_z,  the residual: 2^(scale_a + 2 time) of the divided row's */
typedef struct {
    int64_t s[6]; /* ww, w1, w2, 11, 12, 22 */
    int64_t f[PVID_KAPITZA_P];
    int32_t time;
    int32_t scale_a; /* of A, E, Y; of phi'' and phi */
    int32_t scale_x;
    int32_t scale_z;
    int32_t of_x; /* exponents of d1 and d2 in units of the residual */
    int32_t of_z;
} pvid_kapitza_system_q31;

void pvid_kapitza_project_q31(const pvid_kapitza_estimator_q31 *self, pvid_kapitza_system_q31 *system);

/* Exponents of the columns in units of the integers p: S_ab 2^(of_a + of_b). */
void pvid_kapitza_exponents_q31(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                                int32_t of[PVID_KAPITZA_P]);

/* The sum of squares of the residuals at the present p, >= 0, divided as the sums are. Cost: some 130 products of 64 by
 * 32 bits. */
int64_t pvid_kapitza_residual_q31(const pvid_kapitza_estimator_q31 *self);

#endif
