/* What functions of the fixed-point core promise, as contracts. A proof of a module above them takes them for granted
 * and shows that their conditions are met; the proof of their own module shows that they keep them. */
#ifndef CONTRACTS_H
#define CONTRACTS_H

#include "block_contract.h"
#include "solve/information_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"

/*@ requires -0x7FFFFFFFFFFFFFFF <= x <= 0x7FFFFFFFFFFFFFFE;
    requires -0x7FFFFFFF <= s;
    assigns \result \from x, s;
    ensures -0x7FFFFFFFFFFFFFFF <= \result <= 0x7FFFFFFFFFFFFFFE;
    ensures -0x4000000000000000 <= x <= 0x4000000000000000 ==> -0x4000000000000000 <= \result <= 0x4000000000000000;
    ensures x >= 0 ==> \result >= 0;
    ensures s >= -30 && -0x7FFFFFFF <= x <= 0x7FFFFFFF ==> -0x2000000000000000 <= \result <= 0x2000000000000000; */
int64_t pvid_scale_q31(int64_t x, int32_t s);

/*@ assigns \result \from x;
    ensures 0 <= \result <= 64;
    ensures x <= 0x7FFFFFFF ==> \result <= 31;
    ensures x <= 0x4000000000000000 ==> \result <= 63; */
uint32_t pvid_bit_length_q31(uint64_t x);

/*@ requires x <= 0x4000000000000000;
    assigns \result \from x;
    ensures \result <= 0x80000000;
    ensures x >= 1 ==> \result >= 1;
    ensures x < 0x4000000000000000 ==> \result <= 0x7FFFFFFF; */
uint32_t pvid_square_root_q31(uint64_t x);

/*@ requires 0 <= m <= 0x4000000000000000;
    requires -100000 <= exponent <= 100000;
    assigns \result \from m, exponent;
    ensures 0 <= \result.r <= 0x7FFFFFFF;
    ensures m >= 1 ==> \result.r >= 0x20000000;
    ensures -50032 <= \result.e <= 50001; */
pvid_root_q31 pvid_root_of_q31(int64_t m, int32_t exponent);

/*@ requires -0x4000000000000000 <= x <= 0x4000000000000000;
    requires -1000000 <= exponent <= 1000000;
    assigns \result \from x, exponent;
    ensures -0x40000000 <= \result.m <= 0x40000000;
    ensures x >= 1 ==> \result.m >= 0x20000000;
    ensures x >= 0 ==> \result.m >= 0;
    ensures exponent - 30 <= \result.e <= exponent + 34; */
pvid_scaled_q31 pvid_scaled_of_q31(int64_t x, int32_t exponent);

/*@ requires 0x20000000 <= x.m <= 0x40000000;
    requires -10000 <= x.e <= 10000;
    assigns \result \from x;
    ensures 0x20000000 <= \result.m <= 0x3FFFFFFF;
    ensures -6000 <= \result.e <= 6000; */
pvid_scaled_q31 pvid_inverse_root_q31(pvid_scaled_q31 x);

/* Sums: exponents between those of the parts and what 60 bits of mantissa may take away or a carry add. */
/*@ requires -0x40000000 <= a.m <= 0x40000000 && -0x40000000 <= b.m <= 0x40000000;
    requires -10000 <= a.e <= 10000 && -10000 <= b.e <= 10000;
    assigns \result \from a, b;
    ensures -0x40000000 <= \result.m <= 0x40000000;
    ensures a.m >= 1 && b.m >= 0 ==> \result.m >= 1;
    ensures \result.e >= a.e - 60 || \result.e >= b.e - 60;
    ensures \result.e <= a.e + 4 || \result.e <= b.e + 4; */
pvid_scaled_q31 pvid_scaled_plus_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);

/*@ requires -0x40000000 <= a.m <= 0x40000000 && -0x40000000 <= b.m <= 0x40000000;
    requires -10000 <= a.e <= 10000 && -10000 <= b.e <= 10000;
    assigns \result \from a, b;
    ensures -0x40000000 <= \result.m <= 0x40000000;
    ensures a.m >= 0 && b.m >= 0 ==> \result.m >= 0;
    ensures a.m >= 1 && b.m >= 1 ==> \result.m >= 1;
    ensures a.e + b.e - 30 <= \result.e <= a.e + b.e + 34; */
pvid_scaled_q31 pvid_scaled_times_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);

/*@ requires -0x40000000 <= a.m <= 0x40000000 && 1 <= b.m <= 0x40000000;
    requires -10000 <= a.e <= 10000 && -10000 <= b.e <= 10000;
    assigns \result \from a, b;
    ensures -0x40000000 <= \result.m <= 0x40000000;
    ensures a.m >= 0 ==> \result.m >= 0;
    ensures a.e - b.e - 60 <= \result.e <= a.e - b.e + 4; */
pvid_scaled_q31 pvid_scaled_over_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);

/* ---- the Cholesky factor: what was eliminated is there as long as it is positive ---- */

/*@ assigns \result \from diagonal;
    ensures -15 <= \result <= 17; */
int32_t pvid_half_exponent_q31(int64_t diagonal);

/*@ requires 1 <= self->n <= PVID_MAX_P && j < self->n;
    requires 0 <= self->first_pivot <= 0x40000000;
    requires self->positive == 0 || \subset(s[0 .. j][j], (-0x40000000 .. 0x40000000));
    requires self->positive == 0 || \subset(self->u[0 .. j][j + 1 .. self->n - 1], (-0x40000000 .. 0x40000000));
    assigns self->positive, self->first_pivot, self->pivot[j], self->inverse[j], self->u[0 .. j - 1][j]
        \from self->positive, self->first_pivot, s[0 .. j][j], self->u[0 .. j][j + 1 .. self->n - 1];
    ensures self->positive == 0 || self->positive == 1;
    ensures \old(self->positive) == 0 ==> self->positive == 0;
    ensures 0 <= self->first_pivot <= 0x40000000;
    ensures self->positive != 0 ==> \initialized(&self->u[0 .. j - 1][j]);
    ensures self->positive != 0 ==> \subset(self->u[0 .. j - 1][j], (-0x40000000 .. 0x40000000));
    ensures self->positive != 0 ==> \initialized(&self->pivot[j]) && 1 <= self->pivot[j] <= 0x1000000000000000;
    ensures self->positive != 0 ==> \initialized(&self->inverse[j].m) && 0x3FFFFFFF <= self->inverse[j].m <= 0x7FFFFFFF;
    ensures self->positive != 0 ==> \initialized(&self->inverse[j].k) && 0 <= self->inverse[j].k <= 31;
    ensures self->positive != 0 ==> 0x10000000 <= s[j][j] <= 0x40000000; */
void pvid_cholesky_eliminate_q31(pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P], size_t j);

/*@ requires 1 <= self->n <= PVID_MAX_P;
    requires \subset(self->pivot[0 .. self->n - 1], (1 .. 0x4000000000000000));
    assigns \result \from self->pivot[0 .. self->n - 1], s[0 .. self->n - 1][0 .. self->n - 1];
    ensures 0 <= \result <= 0x40000000; */
int32_t pvid_cholesky_least_pivot_q31(const pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P]);

/*@ requires 1 <= self->n <= PVID_MAX_P;
    requires \subset(rhs[0 .. self->n - 1], (-0x40000000 .. 0x40000000));
    assigns x[0 .. self->n - 1] \from *self, rhs[0 .. self->n - 1];
    ensures \initialized(x + (0 .. self->n - 1));
    ensures \subset(x[0 .. self->n - 1], (-0x40000000 .. 0x40000000)); */
void pvid_cholesky_lower_q31(const pvid_cholesky_q31 *self, const int32_t rhs[], int32_t x[]);

/*@ requires 1 <= self->n <= PVID_MAX_P;
    requires \subset(rhs[0 .. self->n - 1], (-0x7FFFFFFFFFFFFFFF .. 0x7FFFFFFFFFFFFFFE));
    assigns \result \from *self, rhs[0 .. self->n - 1];
    assigns x[0 .. self->n - 1] \from *self, rhs[0 .. self->n - 1];
    ensures -60 <= \result <= 124;
    ensures \initialized(x + (0 .. self->n - 1));
    ensures \subset(x[0 .. self->n - 1], (-0x40000000 .. 0x40000000)); */
int32_t pvid_cholesky_solve_q31(const pvid_cholesky_q31 *self, const int64_t rhs[], int32_t x[]);

/* ---- the sums ---- */

/*@ requires \valid_read(model) && 1 <= model->n_theta <= PVID_MAX_THETA_Q31;
    requires forgetting_groups == 0 || 4 <= forgetting_groups <= 0x1000000;
    assigns *self \from model->n_theta, forgetting_groups, row_weight;
    ensures \initialized(&self->exponent) && self->exponent == 0;
    ensures \initialized(&self->block) && 1 <= self->block <= 64;
    ensures \initialized(&self->retention) && 1 <= self->retention; */
void pvid_information_init_q31(pvid_information_q31 *self, const pvid_model_q31 *model, uint32_t forgetting_groups,
                               uint32_t row_weight);

#endif
