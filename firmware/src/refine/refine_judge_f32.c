#include "number/uncontracted.h"

#include "refine/refine_judge_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "refine/refine_solve_f32.h"
#include "refine_model_f32.h"

#define N PVID_REFINE_PARAMETERS

/* Standard errors of both estimates by which they may differ. */
#define ERRORS 5.0f

float pvid_refine_root_f32(float level)
{
    return sqrtf((level > 1.0f) ? level : 1.0f);
}

bool pvid_refine_within_f32(float x, float limit)
{
    return (x > -limit) && (x < limit);
}

PVID_COLD void pvid_refine_assess_begin_f32(pvid_refine_estimate_f32 *estimate)
{
    memset(estimate->covariance, 0, sizeof estimate->covariance);
}

PVID_COLD void pvid_refine_assess_column_f32(pvid_refine_estimate_f32 *estimate, const float triangle[], size_t column,
                                             float variance)
{
    float x[N];
    const size_t end = column + 1u;
    pvid_refine_inverse_column_f32(triangle, column, x);
    for (size_t i = 0; i < end; i++) {
        const float scaled = variance * x[i];
        for (size_t j = 0; j < end; j++) {
            estimate->covariance[i][j] += scaled * x[j];
        }
    }
}

/* The standard errors of r from the covariance of its steps. */
PVID_COLD static void set_errors(pvid_refine_estimate_f32 *estimate)
{
    for (size_t i = 0; i < N; i++) {
        const float sd = sqrtf(estimate->covariance[i][i]);
        estimate->se[i] = pvid_refine_is_logarithmic_f32(i) ? (sd * estimate->r[i]) : sd;
    }
}

PVID_COLD void pvid_refine_assess_end_f32(pvid_refine_estimate_f32 *estimate, const float r[], float level, float clash)
{
    estimate->level = level;
    estimate->clash = clash;
    memcpy(estimate->r, r, sizeof estimate->r);
    set_errors(estimate);
}

PVID_COLD void pvid_refine_add_shared_f32(pvid_refine_estimate_f32 *estimate, const float shared[])
{
    size_t of_row = 0; /* its standard deviation, then its correlations with the others */
    for (size_t a = 0; a < PVID_REFINE_P; a++) {
        const size_t i = pvid_refine_place_of_p[a];
        size_t of_column = of_row;
        for (size_t b = a; b < PVID_REFINE_P; b++) {
            const size_t j = pvid_refine_place_of_p[b];
            const float correlation = (a == b) ? 1.0f : shared[of_row + (b - a)];
            const float common = (shared[of_row] * shared[of_column]) * correlation;
            estimate->covariance[i][j] += common;
            estimate->covariance[j][i] = estimate->covariance[i][j];
            of_column += (size_t)PVID_REFINE_P - b;
        }
        of_row += (size_t)PVID_REFINE_P - a;
    }
    set_errors(estimate);
}

/* Whether the two estimates of an entry of r agree. */
static bool agrees(const pvid_refine_estimate_f32 *estimate, size_t place, float weak, float weak_se, float distance)
{
    const float x = estimate->r[place];
    const bool logarithmic = pvid_refine_is_logarithmic_f32(place);
    const float errors = sqrtf((estimate->se[place] * estimate->se[place]) + (weak_se * weak_se));
    const float allowed = (ERRORS * errors) + (logarithmic ? (distance * x) : distance);
    const float difference = x - weak;
    return (difference >= -allowed) && (difference <= allowed);
}

PVID_COLD pvid_reason pvid_refine_verdict_f32(const pvid_refine_estimate_f32 *estimate,
                                              const pvid_refine_config_f32 *config, const float weak[],
                                              const float weak_se[])
{
    bool certain = true;
    for (size_t i = 0; i < N; i++) {
        const bool logarithmic = pvid_refine_is_logarithmic_f32(i);
        certain = certain && pvid_finite_f32(estimate->r[i]) && pvid_finite_f32(estimate->se[i]) &&
                  (!logarithmic || pvid_refine_is_width(i) || (estimate->se[i] <= (config->se_max * estimate->r[i])));
    }
    if (!certain) {
        return PVID_HELD_UNCERTAIN;
    }
    bool agree = true;
    float ratio = 1.0f; /* product of the standard errors over the weak form's */
    for (size_t i = 0; i < PVID_REFINE_P; i++) {
        const size_t place = pvid_refine_place_of_p[i];
        ratio *= estimate->se[place] / weak_se[i];
        agree = agree && agrees(estimate, place, weak[place], weak_se[i], config->distance);
    }
    if (!agree) {
        return PVID_HELD_DISAGREES;
    }
    return ((config->distance > 0.0f) || (ratio <= 1.0f)) ? PVID_UPDATED : PVID_HELD_UNCERTAIN;
}
