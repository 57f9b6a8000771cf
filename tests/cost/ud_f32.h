/* Recursive least squares of all n parameters in Bierman's U-D form, float32: P = U D U^T, which stays positive where
 * the packed P of rls_f32.h does not. */
#ifndef UD_F32_H
#define UD_F32_H

#define UD_N 11

typedef struct {
    float inverse_lambda;
    float lambda;
    float theta[UD_N];
    float d[UD_N];
    float u[(UD_N * (UD_N - 1)) / 2]; /* above the diagonal, by columns */
} ud_f32;

void ud_init_f32(ud_f32 *self, float lambda, float p0);
void ud_step_f32(ud_f32 *self, const float n[UD_N], float y);

#endif
