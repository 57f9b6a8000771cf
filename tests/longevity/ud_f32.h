/* A baseline of the longevity bench: recursive least squares in Bierman's UD form, float32.
 *
 *   P = U D U^T, U unit upper triangular, D diagonal: P cannot lose its symmetry, nor its sign while D is finite.
 */
#ifndef UD_F32_H
#define UD_F32_H

#define UD_N 11

typedef struct {
    float lambda;
    float theta[UD_N];
    float d[UD_N];
    float u[UD_N][UD_N]; /* above the diagonal */
} ud_f32;

void ud_init_f32(ud_f32 *self, float lambda, float p0);
void ud_step_f32(ud_f32 *self, const float n[UD_N], float y);

#endif
