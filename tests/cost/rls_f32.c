#include "rls_f32.h"

void rls_init_f32(rls_f32 *self, float lambda, float p0)
{
    self->lambda = lambda;
    self->inverse_lambda = 1.0f / lambda;
    uint16_t k = 0;
    for (uint8_t i = 0; i < RLS_N; i++) {
        self->theta[i] = 0.0f;
        for (uint8_t j = 0; j <= i; j++) {
            self->p[k] = (i == j) ? p0 : 0.0f;
            k++;
        }
    }
}

void rls_step_f32(rls_f32 *self, const float n[RLS_N], float y)
{
    float pn[RLS_N];
    const float *p = self->p;
    for (uint8_t i = 0; i < RLS_N; i++) { /* each stored entry serves both triangles */
        float sum = 0.0f;
        const float ni = n[i];
        for (uint8_t j = 0; j < i; j++) {
            sum += p[j] * n[j];
            pn[j] += p[j] * ni;
        }
        pn[i] = sum + (p[i] * ni);
        p += i + 1;
    }
    float denominator = self->lambda;
    float e = y;
    for (uint8_t i = 0; i < RLS_N; i++) {
        denominator += n[i] * pn[i];
        e -= n[i] * self->theta[i];
    }
    const float inverse = 1.0f / denominator;
    float *q = self->p;
    for (uint8_t i = 0; i < RLS_N; i++) {
        const float gain = pn[i] * inverse;
        self->theta[i] += gain * e;
        for (uint8_t j = 0; j <= i; j++) {
            q[j] = (q[j] - (gain * pn[j])) * self->inverse_lambda;
        }
        q += i + 1;
    }
}
