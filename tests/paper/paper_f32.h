/* The paper's identifier on the core in its literal form, float32: equations (1) to (5) of pvid.oracle.paper. */
#ifndef PAPER_F32_H
#define PAPER_F32_H

#include <string.h>

#include "pvid/differentiator.h"
#include "pvid/estimator.h"
#include "pvid/fnv_word.h"

typedef struct {
    float rate; /* samples per second */
    float l1;   /* [m] */
    pvid_estimator_config_f32 estimator;
} paper_config_f32;

typedef struct {
    pvid_differentiator_f32 phi;
    pvid_differentiator_f32 y;
    float l1;
    pvid_estimator_f32 estimator;
} paper_f32;

/* (3) */
static void paper_theta_f32(const float p[], float theta[])
{
    const float w = p[0];
    const float d1 = p[1];
    const float d2 = p[2];
    const float all[11] = {w,  w * w,  d1,         d1 * w,         d1 * w * w,        d1 * w * w * w,
                           d2, d2 * w, d2 * w * w, d2 * w * w * w, d2 * w * w * w * w};
    memcpy(theta, all, sizeof all);
}

/* (4): the entries of C by columns */
static const uint8_t paper_row[18] = {0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10};
static const uint8_t paper_column[18] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 2};

static void paper_jacobian_f32(const float p[], float c[])
{
    const float w = p[0];
    const float d1 = p[1];
    const float d2 = p[2];
    const float all[18] = {1.0f,
                           2.0f * w,
                           d1,
                           2.0f * d1 * w,
                           3.0f * d1 * w * w,
                           d2,
                           2.0f * d2 * w,
                           3.0f * d2 * w * w,
                           4.0f * d2 * w * w * w,
                           1.0f,
                           w,
                           w * w,
                           w * w * w,
                           1.0f,
                           w,
                           w * w,
                           w * w * w,
                           w * w * w * w};
    memcpy(c, all, sizeof all);
}

static const pvid_model_f32 paper_model_f32 = {
    .n_theta = 11,
    .n_p = 3,
    .n_kinds = 1,
    .n_moments = 66,
    .n_c = 18,
    .positive = 7,
    .c_row = paper_row,
    .c_column = paper_column,
    .theta = paper_theta_f32,
    .jacobian = paper_jacobian_f32,
};

static pvid_status paper_init_f32(paper_f32 *self, const paper_config_f32 *config)
{
    const pvid_fir_bank_f32 five = {.half = 2, .stride = 1, .weights = pvid_five_points_f32};
    (void)pvid_differentiator_init_f32(&self->phi, &five, config->rate);
    (void)pvid_differentiator_init_f32(&self->y, &five, config->rate);
    self->l1 = config->l1;
    return pvid_estimator_init_f32(&self->estimator, &config->estimator);
}

/* phi [rad] and y [m]; (2) and (5) */
static pvid_reason paper_step_f32(paper_f32 *self, const float sample[2])
{
    float phi[PVID_ORDERS];
    float of_y[PVID_ORDERS];
    (void)pvid_differentiator_step_f32(&self->phi, sample[0], phi);
    if (!pvid_differentiator_step_f32(&self->y, sample[1] / self->l1, of_y)) {
        return PVID_WARMING_UP;
    }
    const float u0 = of_y[2];
    const float u1 = of_y[3];
    const float u2 = of_y[4];
    const float uu = u0 * u0;
    const float y = ((uu * phi[4]) - (2.0f * u0 * u1 * phi[3])) + (((2.0f * u1 * u1) - (u0 * u2)) * phi[2]);
    const float n[11] = {((-2.0f * u0 * phi[4]) + (2.0f * u1 * phi[3])) + (u2 * phi[2]),
                         -phi[4],
                         -uu * u0 * phi[2],
                         -3.0f * uu * phi[2],
                         -3.0f * u0 * phi[2],
                         -phi[2],
                         -uu * uu * phi[0],
                         -4.0f * uu * u0 * phi[0],
                         -6.0f * uu * phi[0],
                         -4.0f * u0 * phi[0],
                         -phi[0]};
    return pvid_estimator_step_f32(&self->estimator, n, y);
}

static uint32_t paper_hash_f32(uint32_t hash, const pvid_estimator_f32 *estimator, pvid_reason reason)
{
    uint32_t continued = hash;
    for (uint32_t a = 0; a < 3u; a++) {
        uint32_t word;
        memcpy(&word, &estimator->p[a], sizeof word);
        continued = pvid_fnv_word(continued, word);
    }
    (void)reason;
    return continued;
}

#endif
