#include "number/uncontracted.h"

#include <stdbool.h>
#include <stddef.h>

#include "keep/fingerprint_f32.h"
#include "keep/snapshot.h"
#include "pvid/snapshot.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_weak_f32, field))

static const uint32_t layout[] = {
    sizeof(pvid_weak_f32),
    sizeof(pvid_weak_angle_f32),
    sizeof(void *),
    PLACE(dt),
    PLACE(phi),
    PLACE(front),
    PLACE(front.ring),
    PLACE(curvature),
    PLACE(window),
    PLACE(finish),
    PLACE(finish.whiten),
    PLACE(finish.solve),
    PLACE(finish.solve.sums),
    PLACE(finish.solve.work),
    PLACE(finish.candidate),
    PLACE(term),
    PLACE(sums),
    PLACE(estimator),
    PLACE(estimator.information.low),
    PLACE(estimator.p),
    PLACE(estimator.innovation),
    PLACE(estimator.counters),
    PLACE(trust),
    PLACE(trust.groups),
    PLACE(trust.estimate),
    PLACE(trust.copy),
    (uint32_t)offsetof(pvid_weak_angle_f32, remainder),
    (uint32_t)offsetof(pvid_weak_angle_f32, ring),
    PVID_MAX_P,
    PVID_MAX_THETA,
    PVID_MAX_MOMENTS,
    PVID_MAX_TAPS,
    PVID_MAX_DECIMATION,
    PVID_MAX_FUNCTIONS,
    PVID_MAX_WEAK_WINDOW,
};

/* The memory of the full-angle correction is separate from the identifier; in a snapshot it follows it. */
static bool has_angle(const pvid_weak_config_f32 *config)
{
    return config->full_angle || config->friction;
}

static const pvid_snapshot_pointer pointers[] = {
    {PLACE(design), PVID_SNAPSHOT_OF_INIT},
    {PLACE(angle), PVID_SNAPSHOT_OF_INIT},
    {PLACE(front.smooth), PVID_SNAPSHOT_OF_INIT},
    {PLACE(front.second), PVID_SNAPSHOT_OF_INIT},
    {PLACE(finish.angle), PVID_SNAPSHOT_OF_INIT},
    {PLACE(finish.solve.fallback), PLACE(trust.estimate.p)},
    {PLACE(finish.solve.noise), PVID_SNAPSHOT_OF_INIT},
    {PLACE(finish.solve.estimate), PLACE(finish.candidate)},
    {PLACE(estimator.model), PVID_SNAPSHOT_OF_INIT},
};
static const pvid_snapshot_shape shape = {sizeof(pvid_weak_f32), pointers, sizeof pointers / sizeof pointers[0]};

static pvid_snapshot_identity identity_of(const pvid_weak_config_f32 *config)
{
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_WEAK_F32,
        .layout = pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]),
        .config = pvid_fingerprint_weak_f32(config),
        .bytes = sizeof(pvid_weak_f32) + (has_angle(config) ? sizeof(pvid_weak_angle_f32) : 0u),
    };
    return identity;
}

/* Whether init has accepted a configuration. */
static bool is_ready(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, const uint8_t image[])
{
    const bool ready = (self != NULL) && (config != NULL) && (image != NULL) && (self->design != NULL);
    PVID_ASSERT(ready && (self->design == config->design));
    return ready;
}

size_t pvid_snapshot_save_weak_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                   uint8_t image[], size_t room)
{
    if (!is_ready(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    const pvid_weak_angle_f32 *behind = has_angle(config) ? self->angle : NULL;
    return pvid_snapshot_save(image, room, &identity, generation, self, &shape, behind);
}

pvid_snapshot_status pvid_snapshot_restore_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                    const uint8_t image[], size_t length)
{
    if (!is_ready(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    pvid_weak_angle_f32 *behind = has_angle(config) ? self->angle : NULL;
    const pvid_snapshot_status status =
        pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &shape, behind);
    if (status == PVID_SNAPSHOT_RESTORED) {
        self->finish.angle = pvid_snapshot_had_pointer(image, PLACE(finish.angle)) ? self->angle : NULL;
    }
    return status;
}
