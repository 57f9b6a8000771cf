/* The change of the columns over a big step, from the Jacobian K, D, B in `kick`. A part of refine_pass_f32.c. */
#ifndef PVID_REFINE_KICK_F32_H
#define PVID_REFINE_KICK_F32_H

#include <stddef.h>
#include <string.h>

#include "refine/refine_motion_f32.h"

#if PVID_REFINE_ORDER == 2

/* An entry of x + H/2 D x. */
PVID_ALWAYS_INLINE float damped(const float D[], float half, const float x[], size_t row)
{
    float sum = D[row * N_Q] * x[0];
    PVID_UNROLL for (size_t k = 1; k < N_Q; k++)
    {
        sum += D[(row * N_Q) + k] * x[k];
    }
    return x[row] + (half * sum);
}

/* H (I + H/2 D) times K + H^2/12 K^2, D and B: the kick's mean velocity is that of the middle. */
static void make_kick(pvid_refine_pass_f32 *self)
{
    const float big = (float)PVID_REFINE_SUB * self->h;
    const float half = 0.5f * big;
    const float g = (big * big) * (1.0f / 12.0f);
    float *kick = self->kick;
    float K[N_Q * N_Q];
    float D[N_Q * N_Q];
    PVID_UNROLL for (size_t i = 0; i < (size_t)(N_Q * N_Q); i++)
    {
        K[i] = kick[i];
        D[i] = kick[(N_Q * N_Q) + i];
    }
    PVID_UNROLL for (size_t j = 0; j < N_Q; j++)
    {
        float of_q[N_Q];
        float of_v[N_Q];
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            float square = K[i * N_Q] * K[j];
            PVID_UNROLL for (size_t k = 1; k < N_Q; k++)
            {
                square += K[(i * N_Q) + k] * K[(k * N_Q) + j];
            }
            of_q[i] = big * (K[(i * N_Q) + j] + (g * square));
            of_v[i] = big * D[(i * N_Q) + j];
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            kick[(i * N_Q) + j] = damped(D, half, of_q, i);
            kick[(N_Q * N_Q) + (i * N_Q) + j] = damped(D, half, of_v, i);
        }
    }
    PVID_UNROLL for (size_t j = 0; j < PVID_REFINE_MOVING; j++)
    {
        float of_r[N_Q];
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            of_r[i] = big * kick[(2 * N_Q * N_Q) + (j * N_Q) + i];
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            kick[(2 * N_Q * N_Q) + (j * N_Q) + i] = damped(D, half, of_r, i);
        }
    }
}

#else

/* product = first second */
static void multiply(float first[][N_Q], float second[][N_Q], float product[][N_Q])
{
    for (size_t i = 0; i < N_Q; i++) {
        for (size_t j = 0; j < N_Q; j++) {
            float sum = first[i][0] * second[0][j];
            for (size_t k = 1; k < N_Q; k++) {
                sum += first[i][k] * second[k][j];
            }
            product[i][j] = sum;
        }
    }
}

/* F = t (1 + tK/2 (1 + tK/3 (1 + tK/4))), the columns' change over the time t with a constant K from their rates. */
static void make_factor(const float K[], float t, float factor[][N_Q])
{
    float rates[N_Q][N_Q];
    memcpy(rates, K, sizeof rates);
    memset(factor, 0, sizeof rates);
    for (size_t i = 0; i < N_Q; i++) {
        factor[i][i] = t;
    }
    for (size_t n = 4; n > 1u; n--) {
        const float part = t / (float)n;
        float next[N_Q][N_Q];
        multiply(rates, factor, next);
        for (size_t i = 0; i < N_Q; i++) {
            for (size_t j = 0; j < N_Q; j++) {
                factor[i][j] = (part * next[i][j]) + ((i == j) ? t : 0.0f);
            }
        }
    }
}

/* F K and F B. */
static void spread(float kick[], float factor[][N_Q])
{
    float K[N_Q * N_Q];
    memcpy(K, kick, sizeof K);
    for (size_t i = 0; i < N_Q; i++) {
        for (size_t j = 0; j < N_Q; j++) {
            float sum = factor[i][0] * K[j];
            for (size_t k = 1; k < N_Q; k++) {
                sum += factor[i][k] * K[(k * N_Q) + j];
            }
            kick[(i * N_Q) + j] = sum;
        }
    }
    for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
        float *of_r = &kick[(N_Q * N_Q) + (j * N_Q)];
        float B[N_Q];
        memcpy(B, of_r, sizeof B);
        for (size_t i = 0; i < N_Q; i++) {
            float sum = factor[i][0] * B[0];
            for (size_t k = 1; k < N_Q; k++) {
                sum += factor[i][k] * B[k];
            }
            of_r[i] = sum;
        }
    }
}

#if !PVID_REFINE_RUNGE_KUTTA
/* F K and F B over a big step. */
static void make_kick(pvid_refine_pass_f32 *self)
{
    float factor[N_Q][N_Q];
    make_factor(self->kick, (float)PVID_REFINE_SUB * self->h, factor);
    spread(self->kick, factor);
}
#endif

#endif

#endif
