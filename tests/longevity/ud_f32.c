#include "ud_f32.h"

#include <stddef.h>
#include <string.h>

void ud_init_f32(ud_f32 *self, float lambda, float p0)
{
    memset(self, 0, sizeof *self);
    self->lambda = lambda;
    for (size_t i = 0; i < UD_N; i++) {
        self->d[i] = p0;
        self->u[i][i] = 1.0f;
    }
}

/* Bierman, Factorization Methods for Discrete Sequential Estimation (1977), V.3, with lambda for the noise. */
void ud_step_f32(ud_f32 *self, const float n[UD_N], float y)
{
    float f[UD_N]; /* U^T N */
    float v[UD_N]; /* D f */
    float gain[UD_N];
    float e = y;
    for (size_t j = 0; j < UD_N; j++) {
        f[j] = n[j];
        for (size_t i = 0; i < j; i++) {
            f[j] += self->u[i][j] * n[i];
        }
        v[j] = self->d[j] * f[j];
        e -= n[j] * self->theta[j];
    }
    float alpha = self->lambda;
    for (size_t j = 0; j < UD_N; j++) {
        const float before = alpha;
        alpha += f[j] * v[j];
        const float ratio = f[j] / before;
        self->d[j] = (self->d[j] * (before / alpha)) / self->lambda;
        gain[j] = v[j];
        for (size_t i = 0; i < j; i++) {
            const float old = self->u[i][j];
            self->u[i][j] = old - (ratio * gain[i]);
            gain[i] += v[j] * old;
        }
    }
    for (size_t i = 0; i < UD_N; i++) {
        self->theta[i] += (gain[i] / alpha) * e;
    }
}
