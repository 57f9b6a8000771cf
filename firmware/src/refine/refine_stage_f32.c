#include "number/uncontracted.h"

#include "pvid/refine.h"

static void step(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak)
{
    (void)pvid_refine_step_f32(self, sample, weak);
}

const pvid_weak_stage_f32 pvid_refine_stage_f32 = {
    .init = pvid_refine_init_f32,
    .step = step,
    .gap = pvid_refine_gap_f32,
    .freeze = pvid_refine_freeze_f32,
};
