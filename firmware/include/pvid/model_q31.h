/* pvid/model_q31.h - a mechanism's model for the fixed-point estimator.
 *
 * As model.h: theta = f(p) and the non-zeros of its Jacobian C. Numbers are integers with a format: a value is its
 * integer times 2^-bits. The configuration defines the formats of p; `formats` returns those of theta and C. theta
 * and C are int64 within +-2^60, so that no bit of p is lost.
 */
#ifndef PVID_MODEL_Q31_H
#define PVID_MODEL_Q31_H

#include <stdint.h>

#include "pvid/config.h"

/* m 2^e: 2^29 <= |m| <= 2^30, or 0. */
typedef struct {
    int32_t m;
    int32_t e;
} pvid_scaled_q31;

/* (x 2^-down) multiplier 2^-shift: an exact sum in another format. */
typedef struct {
    uint8_t down;       /* 0..62 */
    uint8_t shift;      /* 0..62 */
    int32_t multiplier; /* > 0 */
} pvid_rescale_q31;

/* theta and C as numbers of any size (scaled_q31.h), for models that need no formats, as the model compiler writes
 * them. Set `adapter` to &pvid_read_scaled_q31: then the code that reads such numbers is part of the image, otherwise
 * not. theta is stored with 40 bits at the start and saturates at 2^20 times its size there. */
typedef struct pvid_scaled_adapter_q31 pvid_scaled_adapter_q31;
extern const pvid_scaled_adapter_q31 pvid_read_scaled_q31;

typedef struct {
    void (*theta)(const pvid_scaled_q31 p[], pvid_scaled_q31 theta[]); /* as in the model, p in its unit */
    void (*jacobian)(const pvid_scaled_q31 p[], pvid_scaled_q31 c[]);
    const pvid_scaled_adapter_q31 *adapter;
} pvid_scaled_model_q31;

typedef struct {
    uint8_t n_theta;   /* entries of theta and N, 1..PVID_MAX_THETA_Q31 */
    uint8_t n_p;       /* free parameters, 1..PVID_MAX_P; kappa refers to p[0] */
    uint8_t n_kinds;   /* kinds of rows, see model.h; 0 or 1: all rows have all theta */
    uint8_t n_c;       /* structural non-zeros of C, 1..PVID_MAX_C_Q31 */
    uint32_t positive; /* bit i set: p[i] > 0; steps are relative to p[i] */

    const uint8_t *kind_end; /* [n_kinds] one past the last theta of each kind, see model.h; NULL for one kind */
    const uint8_t *c_row;    /* [n_c] row in theta of each non-zero of C, ascending in a column */
    const uint8_t *c_column; /* [n_c] its column (index in p), ascending */

    /* theta[n_theta] = f(p) */
    void (*theta)(const int32_t p[], int64_t theta[]);
    /* c[n_c] = the non-zeros of d theta / d p at p, in the order of c_row */
    void (*jacobian)(const int32_t p[], int64_t c[]);
    /* formats of theta [n_theta] and C [n_c] for those of p [n_p] */
    void (*formats)(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[]);
    /* In place of these three; NULL: they are set. */
    const pvid_scaled_model_q31 *scaled;
} pvid_model_q31;

#endif
