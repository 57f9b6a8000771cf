/* The paper's identifier on the core in its literal form, fixed point: equations (1) to (5) of pvid.oracle.paper. */
#ifndef PAPER_Q31_H
#define PAPER_Q31_H

#include <string.h>

#include "pvid/detail/shift_q31.h"
#include "pvid/estimator_q31.h"
#include "pvid/fnv_word.h"
#include "pvid/scaled_q31.h"

typedef pvid_scaled_q31 number;

typedef struct {
    number unit[2][5]; /* of the derivatives of phi and y/l1 in twelfths of counts; of order 0 in counts */
    pvid_estimator_config_q31 estimator;
} paper_config_q31;

typedef struct {
    const paper_config_q31 *config;
    int32_t window[2][5];
    uint32_t filled;
    pvid_estimator_q31 estimator;
} paper_q31;

static const number paper_one = {536870912, -29};
static const number paper_two = {536870912, -28};
static const number paper_three = {805306368, -28};
static const number paper_four = {536870912, -27};
static const number paper_six = {805306368, -27};

static number paper_times(number a, number b)
{
    return pvid_scaled_times_q31(a, b);
}

/* (3) */
static void paper_theta_q31(const number p[], number theta[])
{
    theta[0] = p[0];
    theta[1] = paper_times(p[0], p[0]);
    theta[2] = p[1];
    theta[6] = p[2];
    for (size_t i = 3; i < 11u; i++) {
        if (i != 6u) {
            theta[i] = paper_times(theta[i - 1u], p[0]);
        }
    }
}

/* (4): the entries of C by columns */
static const uint8_t paper_row[18] = {0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10};
static const uint8_t paper_column[18] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 2};

static void paper_jacobian_q31(const number p[], number c[])
{
    const number w = p[0];
    const number ww = paper_times(w, w);
    const number www = paper_times(ww, w);
    c[0] = paper_one;
    c[1] = paper_times(paper_two, w);
    c[2] = p[1];
    c[3] = paper_times(paper_times(paper_two, p[1]), w);
    c[4] = paper_times(paper_times(paper_times(paper_three, p[1]), w), w);
    c[5] = p[2];
    c[6] = paper_times(paper_times(paper_two, p[2]), w);
    c[7] = paper_times(paper_times(paper_times(paper_three, p[2]), w), w);
    c[8] = paper_times(paper_times(paper_times(paper_times(paper_four, p[2]), w), w), w);
    c[9] = paper_one;
    c[10] = w;
    c[11] = ww;
    c[12] = www;
    c[13] = paper_one;
    c[14] = w;
    c[15] = ww;
    c[16] = www;
    c[17] = paper_times(www, w);
}

static const pvid_scaled_model_q31 paper_numbers = {paper_theta_q31, paper_jacobian_q31, &pvid_read_scaled_q31};
static const pvid_model_q31 paper_model_q31 = {
    .n_theta = 11,
    .n_p = 3,
    .n_kinds = 1,
    .n_c = 18,
    .positive = 7,
    .c_row = paper_row,
    .c_column = paper_column,
    .scaled = &paper_numbers,
};

static pvid_status paper_init_q31(paper_q31 *self, const paper_config_q31 *config)
{
    memset(self, 0, sizeof *self);
    self->config = config;
    return pvid_estimator_init_q31(&self->estimator, &config->estimator);
}

/* Orders 0 to 4 at the middle of five samples. */
static void paper_derivatives(const int32_t x[5], const number unit[5], number out[5])
{
    const int32_t near_odd = x[3] - x[1];
    const int32_t far_odd = x[4] - x[0];
    const int32_t near_even = (x[3] - x[2]) + (x[1] - x[2]);
    const int32_t far_even = (x[4] - x[2]) + (x[0] - x[2]);
    const int32_t part[5] = {x[2], (8 * near_odd) - far_odd, (16 * near_even) - far_even,
                             (6 * far_odd) - (12 * near_odd), (12 * far_even) - (48 * near_even)};
    for (size_t k = 0; k < 5u; k++) {
        out[k] = paper_times(pvid_scaled_of_q31(part[k], 0), unit[k]);
    }
}

/* x as an integer of `bits` bits after the point; beyond the limit of a row where it has more than 30. */
static int32_t paper_fixed(number x, int8_t bits)
{
    const int32_t up = x.e + bits;
    return ((x.m == 0) || (up <= 0)) ? (int32_t)pvid_round_shift_q31(x.m, (uint32_t)((up < 0) ? -up : 0)) : INT32_MAX;
}

/* (2) and (5); counts of phi and y */
static pvid_reason paper_step_q31(paper_q31 *self, const int32_t sample[2])
{
    number d[2][5];
    for (size_t i = 0; i < 2u; i++) {
        memmove(&self->window[i][0], &self->window[i][1], 4u * sizeof self->window[i][0]);
        self->window[i][4] = sample[i];
        paper_derivatives(self->window[i], self->config->unit[i], d[i]);
    }
    self->filled += (self->filled < 5u) ? 1u : 0u;
    if (self->filled < 5u) {
        return PVID_WARMING_UP;
    }
    const number *phi = d[0];
    const number u0 = d[1][2];
    const number u1 = d[1][3];
    const number u2 = d[1][4];
    const number uu = paper_times(u0, u0);
    const number minus_uu = pvid_scaled_negated_q31(uu);
    const number minus_2 = pvid_scaled_negated_q31(paper_two);
    const number minus_3 = pvid_scaled_negated_q31(paper_three);
    const number minus_4 = pvid_scaled_negated_q31(paper_four);
    const number minus_6 = pvid_scaled_negated_q31(paper_six);
    const number y = pvid_scaled_plus_q31(
        pvid_scaled_minus_q31(paper_times(uu, phi[4]),
                              paper_times(paper_times(paper_times(paper_two, u0), u1), phi[3])),
        paper_times(pvid_scaled_minus_q31(paper_times(paper_times(paper_two, u1), u1), paper_times(u0, u2)), phi[2]));
    const number n[11] = {
        pvid_scaled_plus_q31(pvid_scaled_plus_q31(paper_times(paper_times(minus_2, u0), phi[4]),
                                                  paper_times(paper_times(paper_two, u1), phi[3])),
                             paper_times(u2, phi[2])),
        pvid_scaled_negated_q31(phi[4]),
        paper_times(paper_times(minus_uu, u0), phi[2]),
        paper_times(paper_times(minus_3, uu), phi[2]),
        paper_times(paper_times(minus_3, u0), phi[2]),
        pvid_scaled_negated_q31(phi[2]),
        paper_times(paper_times(minus_uu, uu), phi[0]),
        paper_times(paper_times(paper_times(minus_4, uu), u0), phi[0]),
        paper_times(paper_times(minus_6, uu), phi[0]),
        paper_times(paper_times(minus_4, u0), phi[0]),
        pvid_scaled_negated_q31(phi[0]),
    };
    const pvid_estimator_config_q31 *formats = &self->config->estimator;
    int32_t row[11];
    for (size_t i = 0; i < 11u; i++) {
        row[i] = paper_fixed(n[i], formats->n_bits[i]);
    }
    const pvid_reason added = pvid_estimator_add_q31(&self->estimator, row, paper_fixed(y, formats->y_bits));
    return (added == PVID_ACCUMULATED) ? pvid_estimator_update_q31(&self->estimator) : added;
}

static uint32_t paper_hash_q31(uint32_t hash, const pvid_estimator_q31 *estimator, pvid_reason reason)
{
    uint32_t continued = hash;
    for (uint32_t a = 0; a < 3u; a++) {
        continued = pvid_fnv_word(continued, (uint32_t)estimator->p[a]);
    }
    (void)reason;
    return continued;
}

#endif
