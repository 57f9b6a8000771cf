#include <stdbool.h>
#include <stddef.h>

#include "persist/fingerprint_weak_q31.h"
#include "persist/snapshot.h"
#include "pvid/snapshot_weak_q31.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_weak_q31, field))

/* Sizes and places of the parts, and the sizes of their arrays. */
static const uint32_t layout[] = {
    sizeof(pvid_weak_q31),
    sizeof(pvid_weak_drive_q31),
    sizeof(pvid_weak_front_q31),
    sizeof(pvid_weak_values_q31),
    sizeof(pvid_weak_sums_q31),
    sizeof(pvid_weak_window_q31),
    sizeof(pvid_weak_finish_q31),
    sizeof(pvid_estimator_q31),
    sizeof(pvid_estimator_solve_q31),
    sizeof(pvid_trust_q31),
    sizeof(pvid_estimate_q31),
    sizeof(pvid_reason),
    sizeof(void *),
    PLACE(drive),
    PLACE(accumulator),
    PLACE(accumulator.values),
    PLACE(accumulator.sums),
    PLACE(accumulator.window),
    PLACE(finish),
    PLACE(finish.gate),
    PLACE(finish.scores),
    PLACE(finish.error),
    PLACE(finish.work),
    PLACE(finish.work.rows.parts),
    PLACE(estimator),
    PLACE(estimator.p),
    PLACE(estimator.counters),
    PLACE(trust),
    PLACE(trust.estimate),
    PLACE(trust.copy),
    PVID_MAX_P,
    PVID_MAX_THETA_Q31,
    PVID_MAX_MOMENTS_Q31,
    PVID_MAX_C_Q31,
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
};

static const pvid_snapshot_pointer pointers[] = {
    {PLACE(design), PVID_SNAPSHOT_OF_INIT},
    {PLACE(drive_min), PVID_SNAPSHOT_OF_INIT},
    {PLACE(accumulator.design), PVID_SNAPSHOT_OF_INIT},
    {PLACE(accumulator.front.offset), PVID_SNAPSHOT_OF_INIT},
    {PLACE(estimator.model), PVID_SNAPSHOT_OF_INIT},
    {PLACE(trust.config.shared), PVID_SNAPSHOT_OF_INIT},
};
static const pvid_snapshot_shape shape = {sizeof(pvid_weak_q31), pointers, sizeof pointers / sizeof pointers[0]};

static pvid_snapshot_identity identity_of(const pvid_weak_config_q31 *config)
{
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_WEAK_Q31,
        .layout = pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]),
        .model = pvid_fingerprint_weak_model_q31(config->design->model),
        .design = pvid_fingerprint_weak_design_q31(config->design),
        .config = pvid_fingerprint_weak_q31(config),
        .bytes = sizeof(pvid_weak_q31),
    };
    return identity;
}

/* Whether init has accepted a configuration. */
static bool is_ready(const pvid_weak_q31 *self, const pvid_weak_config_q31 *config, const uint8_t image[])
{
    const bool ready = (self != NULL) && (config != NULL) && (image != NULL) && (self->design != NULL);
    PVID_ASSERT(ready && (self->design == config->design));
    return ready;
}

size_t pvid_snapshot_save_weak_q31(const pvid_weak_q31 *self, const pvid_weak_config_q31 *config, uint32_t generation,
                                   uint8_t image[], size_t room)
{
    if (!is_ready(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_save(image, room, &identity, generation, self, &shape, NULL);
}

pvid_snapshot_status pvid_snapshot_restore_weak_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config,
                                                    const uint8_t image[], size_t length)
{
    if (!is_ready(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &shape, NULL);
}
