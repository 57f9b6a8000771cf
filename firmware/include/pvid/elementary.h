/* pvid/elementary.h - sine, cosine and sign in float32, with the same bits on every processor.
 *
 * The functions that `pvid model build` writes call these. They use + - * / and comparisons only, no library function;
 * Pure functions: no state, reentrant.
 *
 *   const float moment = weight * pvid_sin_f32(angle);
 */
#ifndef PVID_ELEMENTARY_H
#define PVID_ELEMENTARY_H

#include "pvid/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest |x| [rad] of sine and cosine. Neighbouring floats are 0.001 rad apart there. */
#define PVID_ANGLE_LIMIT_F32 16384.0f

/* sin x, cos x [-1..1] of x [rad], |x| <= PVID_ANGLE_LIMIT_F32; else NaN, so that the estimator refuses the row.
 * Error: below 1.3e-7 for |x| <= 1000, below 3e-7 up to the limit. cos 0 is 1. Method: x less the nearest k pi (for
 * the cosine: the nearest (k + 1/2) pi), with pi in three parts; the products with the first two parts are exact. Then
 * a polynomial of degree 9. Cost: about 20 operations. */
float pvid_sin_f32(float x);
float pvid_cos_f32(float x);

/* Sign of v: -1, 0 or 1; of NaN 0. */
float pvid_sign_f32(float v);

/* v / (|v| + width): a sign that is 1/2 at v = width; width > 0 [unit of v]. */
float pvid_soft_sign_f32(float v, float width);

/* tanh x; of an infinity -1 or 1, of NaN NaN. Error: below 1.7e-6. Method: a quotient of two polynomials of degree 7
 * and 6 up to |x| = 7. Cost: about 15 operations, one of them a division. */
float pvid_tanh_f32(float x);

/* |x| */
float pvid_magnitude_f32(float x);

#ifdef __cplusplus
}
#endif

#endif
