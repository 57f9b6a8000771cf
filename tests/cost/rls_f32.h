/* The baseline of every cost table: recursive least squares of all n parameters, packed, float32.
 *
 * Textbook form, P symmetric and stored once:
 *   k = P N / (lambda + N^T P N),  theta += k (Y - N^T theta),  P = (P - k (P N)^T) / lambda
 */
#ifndef RLS_F32_H
#define RLS_F32_H

#include <stdint.h>

#define RLS_N 11

typedef struct {
    float inverse_lambda;
    float lambda;
    float theta[RLS_N];
    float p[(RLS_N * (RLS_N + 1)) / 2]; /* lower triangle by rows */
} rls_f32;

void rls_init_f32(rls_f32 *self, float lambda, float p0);
void rls_step_f32(rls_f32 *self, const float n[RLS_N], float y);

#endif
