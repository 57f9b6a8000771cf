#include "number/uncontracted.h"

#include "pvid/refine.h"

#include <stddef.h>

#include "refine/refine_solve_f32.h"
#include "refine_model_f32.h"

/* From steps of r to r: steps of a logarithm are relative. */
static float scale_of(const pvid_refine_estimate_f32 *refined, size_t place)
{
    return pvid_refine_is_logarithmic_f32(place) ? refined->r[place] : 1.0f;
}

pvid_stage pvid_refine_best_f32(const pvid_refine_f32 *self, const pvid_estimate_f32 *weak, pvid_estimate_f32 *estimate)
{
    if ((weak == NULL) || (estimate == NULL)) {
        return PVID_STAGE_WEAK;
    }
    *estimate = *weak;
    const pvid_refine_estimate_f32 *refined = pvid_refine_latest_f32(self);
    if (refined == NULL) {
        return PVID_STAGE_WEAK;
    }
    for (size_t i = 0; i < PVID_REFINE_P; i++) {
        const size_t row = pvid_refine_place_of_p[i];
        const float scale = scale_of(refined, row);
        estimate->p[i] = refined->r[row];
        estimate->se[i] = refined->se[row];
        for (size_t j = i; j < PVID_MAX_P; j++) {
            float covariance = 0.0f;
            if (j < PVID_REFINE_P) {
                const size_t column = pvid_refine_place_of_p[j];
                covariance = (scale * scale_of(refined, column)) * refined->covariance[row][column];
            }
            estimate->covariance[i][j] = covariance;
            estimate->covariance[j][i] = covariance;
        }
    }
    return PVID_STAGE_REFINED;
}
