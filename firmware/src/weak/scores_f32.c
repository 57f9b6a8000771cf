#include "number/uncontracted.h"

#include "number/short_loops.h"

/* C^T (sum N e + g) is a window's score at the p before its steps; g compensates noise in N. With S^-1 = V a step is V
 * times the sum of scores, so that its variance over so many windows in the sums is, theory.md 4, (7a),
 *
 *   windows V Gamma V,   Gamma the mean of score score^T, or of that and of score before^T + before score^T,
 *
 * whichever gives more: neighbours share half of their samples. A mean gives the newest window the weight 2/(k + 2), k
 * windows before it, but not less than forgetting does. The first windows, at a poor p, do not show the scatter at a
 * good one: the means begin anew with a window whose residuals are far below their mean. */
#include "weak/scores_f32.h"

#include <string.h>

#include "number/count.h"
#include "number/unroll.h"

/* Far below: this part of the mean. By chance the mean square of 9 residuals is below it once in 10^6 windows. */
#define FAR_BELOW 0.05f

void pvid_weak_scores_init_f32(pvid_weak_scores_f32 *self, float forgetting)
{
    memset(self, 0, sizeof *self);
    self->memory = forgetting;
}

void pvid_weak_scores_skip_f32(pvid_weak_scores_f32 *self)
{
    self->known = false;
}

PVID_COLD void pvid_weak_scores_take_f32(pvid_weak_scores_f32 *self, const pvid_estimator_f32 *estimator,
                                         const float sum[])
{
    const pvid_model_f32 *model = estimator->model;
    float c[PVID_MAX_C];
    model->jacobian(estimator->p, c);
    memset(self->own, 0, sizeof self->own);
    for (size_t k = 0; k < model->n_c; k++) {
        self->own[model->c_column[k]] += c[k] * sum[model->c_row[k]];
    }
}

PVID_COLD void pvid_weak_scores_add_f32(pvid_weak_scores_f32 *self, size_t n_p, float residual)
{
    if (residual < (FAR_BELOW * self->residual)) {
        self->windows = 0;
        self->known = false;
        memset(self->neighbour, 0, sizeof self->neighbour);
    }
    const float newest = 2.0f / ((float)self->windows + 2.0f);
    const float least = (self->memory > 0.0f) ? (1.0f / self->memory) : 0.0f;
    const float weight = (newest > least) ? newest : least;
    self->residual += weight * (residual - self->residual);
    size_t pair = 0;
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a; b < n_p; b++) {
            const float same = self->own[a] * self->own[b];
            self->same[pair] += weight * (same - self->same[pair]);
            if (self->known) {
                const float both = (self->own[a] * self->before[b]) + (self->before[a] * self->own[b]);
                self->neighbour[pair] += weight * (both - self->neighbour[pair]);
            }
            pair++;
        }
    }
    memcpy(self->before, self->own, sizeof self->before);
    self->known = true;
    pvid_count_up_16(&self->windows);
}

float pvid_weak_scores_variance_f32(const pvid_weak_scores_f32 *self, size_t n_p, size_t a,
                                    const float covariance[][PVID_MAX_P], float wide, float windows)
{
    float same = 0.0f;
    float neighbour = 0.0f;
    size_t pair = 0;
    for (size_t b = 0; b < n_p; b++) {
        const float of_b = covariance[a][b] / wide;
        for (size_t c = b; c < n_p; c++) {
            const float twice = (b == c) ? 1.0f : 2.0f;
            const float both = twice * (of_b * (covariance[a][c] / wide));
            same += both * self->same[pair];
            neighbour += both * self->neighbour[pair];
            pair++;
        }
    }
    return windows * ((neighbour > 0.0f) ? (same + neighbour) : same);
}
