#include "number/uncontracted.h"

#include <stdbool.h>
#include <stddef.h>

#include "persist/fingerprint_weak_f32.h"
#include "persist/snapshot_weak_f32.h"
#include "pvid/snapshot_weak.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_weak_f32, field))

/* Sizes and places of the parts, and the sizes of their arrays. */
static const uint32_t layout[] = {
    sizeof(pvid_weak_f32),
    sizeof(pvid_weak_front_f32),
    sizeof(pvid_weak_history_f32),
    sizeof(pvid_weak_limits_f32),
    sizeof(pvid_weak_sums_f32),
    sizeof(pvid_weak_finish_f32),
    sizeof(pvid_estimator_f32),
    sizeof(pvid_estimator_solve_f32),
    sizeof(pvid_trust_f32),
    sizeof(pvid_estimate_f32),
    sizeof(pvid_reason),
    sizeof(void *),
    PLACE(front),
    PLACE(history),
    PLACE(limits),
    PLACE(sums),
    PLACE(finish.work),
    PLACE(finish),
    PLACE(finish.gate),
    PLACE(finish.error),
    PLACE(finish.white),
    PLACE(finish.scores),
    PLACE(finish.work.solve),
    PLACE(finish.candidate),
    PLACE(estimator),
    PLACE(estimator.p),
    PLACE(estimator.counters),
    PLACE(trust),
    PLACE(trust.estimate),
    PLACE(trust.copy),
    PVID_MAX_P,
    PVID_MAX_THETA,
    PVID_MAX_MOMENTS,
    PVID_MAX_SAMPLES,
    PVID_MAX_RING,
    PVID_MAX_INPUTS,
    PVID_MAX_CHANNELS,
    PVID_MAX_INTEGRANDS,
    PVID_MAX_HARMONICS,
    PVID_MAX_KINDS,
    PVID_MAX_COLUMNS,
    PVID_MAX_POWER,
    PVID_MAX_FUNCTIONS,
    PVID_MAX_BLOCKS,
    PVID_MAX_WINDOWS,
    PVID_MAX_CONSTRAINTS,
    PVID_MAX_DRIFTS,
};

static const pvid_snapshot_pointer pointers[] = {
    {PLACE(design), PVID_SNAPSHOT_OF_INIT},
    {PLACE(refine), PVID_SNAPSHOT_OF_INIT},
    {PLACE(limits.range), PVID_SNAPSHOT_OF_INIT},
    {PLACE(limits.drive_min), PVID_SNAPSHOT_OF_INIT},
    {PLACE(finish.work.solve.fallback), PLACE(trust.estimate.p)},
    {PLACE(finish.work.solve.noise), PLACE(finish.candidate.covariance)},
    {PLACE(finish.work.solve.estimate), PLACE(finish.candidate)},
    {PLACE(estimator.model), PVID_SNAPSHOT_OF_INIT},
    {PLACE(trust.config.shared), PVID_SNAPSHOT_OF_INIT},
};
const pvid_snapshot_shape pvid_snapshot_weak_shape_f32 = {sizeof(pvid_weak_f32), pointers,
                                                          sizeof pointers / sizeof pointers[0]};

pvid_snapshot_identity pvid_snapshot_weak_identity_f32(const pvid_weak_config_f32 *config)
{
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_WEAK_F32,
        .layout = pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]),
        .model = pvid_fingerprint_weak_model_f32(config->design->model),
        .design = pvid_fingerprint_weak_design_f32(config->design),
        .config = pvid_fingerprint_weak_f32(config),
        .bytes = sizeof(pvid_weak_f32),
    };
    return identity;
}

bool pvid_snapshot_weak_is_ready_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                     const uint8_t image[])
{
    const bool ready = (self != NULL) && (config != NULL) && (image != NULL) && (self->design != NULL);
    PVID_ASSERT(ready && (self->design == config->design));
    return ready;
}

size_t pvid_snapshot_save_weak_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                   uint8_t image[], size_t room)
{
    if (!pvid_snapshot_weak_is_ready_f32(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = pvid_snapshot_weak_identity_f32(config);
    return pvid_snapshot_save(image, room, &identity, generation, self, &pvid_snapshot_weak_shape_f32, NULL);
}

pvid_snapshot_status pvid_snapshot_restore_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                    const uint8_t image[], size_t length)
{
    if (!pvid_snapshot_weak_is_ready_f32(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = pvid_snapshot_weak_identity_f32(config);
    return pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &pvid_snapshot_weak_shape_f32, NULL);
}
