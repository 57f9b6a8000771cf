#include "ud_f32.h"

#include <stddef.h>

void ud_init_f32(ud_f32 *self, float lambda, float p0)
{
    self->lambda = lambda;
    self->inverse_lambda = 1.0f / lambda;
    for (size_t i = 0; i < sizeof self->u / sizeof self->u[0]; i++) {
        self->u[i] = 0.0f;
    }
    for (size_t i = 0; i < UD_N; i++) {
        self->theta[i] = 0.0f;
        self->d[i] = p0;
    }
}

void ud_step_f32(ud_f32 *self, const float n[UD_N], float y)
{
    float f[UD_N]; /* U^T n */
    float g[UD_N]; /* D f, then the gain's numerator */
    float e = y;
    const float *column = self->u;
    for (size_t j = 0; j < UD_N; j++) {
        float sum = n[j];
        for (size_t i = 0; i < j; i++) {
            sum += column[i] * n[i];
        }
        f[j] = sum;
        g[j] = self->d[j] * sum;
        e -= n[j] * self->theta[j];
        column += j;
    }
    float alpha = self->lambda + (f[0] * g[0]);
    self->d[0] *= self->lambda / alpha * self->inverse_lambda;
    float *u = self->u;
    for (size_t j = 1; j < UD_N; j++) {
        const float before = alpha;
        u += j - 1u;
        alpha += f[j] * g[j];
        const float ratio = f[j] / before;
        self->d[j] *= (before / alpha) * self->inverse_lambda;
        for (size_t i = 0; i < j; i++) {
            const float old = u[i];
            u[i] = old - (g[i] * ratio);
            g[i] += g[j] * old;
        }
    }
    const float scaled = e / alpha;
    for (size_t i = 0; i < UD_N; i++) {
        self->theta[i] += g[i] * scaled;
    }
}
