#include "number/uncontracted.h"

#include "pvid/snapshot_refine.h"

#include <stdbool.h>

#include "persist/fingerprint_refine_f32.h"
#include "persist/snapshot_weak_f32.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_refine_f32, field))

/* The refinement without its configuration, which keeps the pointers and values of init. */
#define SAVED_BYTES (sizeof(pvid_refine_f32) - offsetof(pvid_refine_f32, h))

/* Sizes and places of the parts, and the sizes of their arrays. */
static const uint32_t layout[] = {
    sizeof(pvid_refine_f32),
    sizeof(pvid_refine_front_f32),
    sizeof(pvid_refine_pass_f32),
    sizeof(pvid_refine_solve_f32),
    sizeof(pvid_refine_estimate_f32),
    PLACE(h),
    PLACE(verdict),
    PLACE(front),
    PLACE(front.ring),
    PLACE(work),
    PLACE(work.sums),
    PLACE(solve),
    PLACE(mark),
    PLACE(estimate),
    PVID_REFINE_RING,
    PVID_REFINE_HALF,
};

static pvid_snapshot_identity identity_of(const pvid_weak_config_f32 *config)
{
    pvid_snapshot_identity identity = pvid_snapshot_weak_identity_f32(config);
    identity.kind = PVID_SNAPSHOT_KIND_REFINE_F32;
    identity.layout ^= pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]);
    identity.model = pvid_fingerprint_refine_model_f32(identity.model);
    identity.config = pvid_fingerprint_refine_f32(identity.config, config->refine->config);
    identity.bytes += SAVED_BYTES;
    return identity;
}

static bool is_ready(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, const uint8_t image[])
{
    return pvid_snapshot_weak_is_ready_f32(self, config, image) && (self->refine != NULL) &&
           (config->refine == self->refine);
}

size_t pvid_snapshot_save_refine_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                     uint8_t image[], size_t room)
{
    if (!is_ready(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_save(image, room, &identity, generation, self, &pvid_snapshot_weak_shape_f32,
                              &self->refine->storage->h);
}

pvid_snapshot_status pvid_snapshot_restore_refine_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                      const uint8_t image[], size_t length)
{
    if (!is_ready(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &pvid_snapshot_weak_shape_f32,
                                 &self->refine->storage->h);
}
