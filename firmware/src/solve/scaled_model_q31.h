/* Models with theta and C of any size (model_q31.h), for the estimator. Private to the core. */
#ifndef PVID_SCALED_MODEL_Q31_H
#define PVID_SCALED_MODEL_Q31_H

#include "pvid/estimator_q31.h"

/* The estimator calls these by the model's pointer, so that an image without such a model does not contain them. */
struct pvid_scaled_adapter_q31 {
    /* theta[n_theta] = f(p) in the formats self->theta_bits */
    void (*theta)(const pvid_estimator_q31 *self, const int32_t p[], int64_t theta[]);
    /* C_k at self->p is value[k] 2^e: writes value[n_c] and adds e to exponent[k] */
    void (*jacobian)(const pvid_estimator_q31 *self, int64_t value[], int32_t exponent[]);
    /* bits[n_theta], the formats of theta, from the start; needs self->settings.p_bits */
    void (*formats)(const pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config, int16_t bits[]);
};

#endif
