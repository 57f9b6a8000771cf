/* Settings of a fixed-point estimator, and the model y = N^T p: M is S, so that what a step needs is known. */
#ifndef IDENTITY_Q31_H
#define IDENTITY_Q31_H

#include "pvid/pvid_q31.h"

/* Gauss-Newton after every group, rows of the usual weight. */
static inline pvid_estimator_config_q31 usual_config_q31(const pvid_model_q31 *model)
{
    const pvid_estimator_config_q31 config = {.model = model,
                                              .row_sd = 256,
                                              .gain = 1 << 30,
                                              .correlation = 1u << 16,
                                              .row_weight = 1u << 16,
                                              .step_limit = 19661,
                                              .divider = 1};
    return config;
}

static inline void identity_theta(const int32_t p[], int64_t theta[])
{
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        theta[i] = p[i];
    }
}

static inline void identity_jacobian(const int32_t p[], int64_t c[])
{
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        c[i] = 1 << 20;
    }
}

static inline void identity_formats(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        theta_bits[i] = p_bits[i];
        c_bits[i] = 20;
    }
}

static const uint8_t identity_places[PVID_MAX_P] = {0, 1, 2, 3};

/* Of n parameters. */
#define IDENTITY_Q31(n)                                                                                                \
    {.n_theta = (n),                                                                                                   \
     .n_p = (n),                                                                                                       \
     .n_c = (n),                                                                                                       \
     .c_row = identity_places,                                                                                         \
     .c_column = identity_places,                                                                                      \
     .theta = identity_theta,                                                                                          \
     .jacobian = identity_jacobian,                                                                                    \
     .formats = identity_formats}

#endif
