#include "number/uncontracted.h"

#include <stdbool.h>
#include <stddef.h>

#include "persist/fingerprint_f32.h"
#include "persist/snapshot.h"
#include "pvid/snapshot.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_strong_f32, field))

static const uint32_t layout[] = {
    sizeof(pvid_strong_f32),
    sizeof(void *),
    PLACE(window.phi_scale),
    PLACE(window.five_points),
    PLACE(window.samples),
    PLACE(drive),
    PLACE(misfit),
    PLACE(misfit.block),
    PLACE(estimator),
    PLACE(estimator.phase),
    PLACE(estimator.mixes),
    PLACE(estimator.counters),
    PLACE(estimator.block),
    PLACE(estimator.sums),
    PLACE(estimator.sums.low),
    PVID_MAX_WINDOW,
};

static const pvid_snapshot_pointer pointers[] = {{PLACE(estimator.config), PVID_SNAPSHOT_OF_INIT}};
static const pvid_snapshot_shape shape = {sizeof(pvid_strong_f32), pointers, sizeof pointers / sizeof pointers[0]};

static pvid_snapshot_identity identity_of(const pvid_strong_config_f32 *config)
{
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_STRONG_F32,
        .layout = pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]),
        .config = pvid_fingerprint_strong_f32(config),
        .bytes = sizeof(pvid_strong_f32),
    };
    return identity;
}

/* Whether init has accepted a configuration. */
static bool is_ready(const pvid_strong_f32 *self, const pvid_strong_config_f32 *config, const uint8_t image[])
{
    const bool ready = (self != NULL) && (config != NULL) && (image != NULL) && (self->estimator.config != NULL);
    PVID_ASSERT(ready);
    return ready;
}

size_t pvid_snapshot_save_strong_f32(const pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                     uint32_t generation, uint8_t image[], size_t room)
{
    if (!is_ready(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_save(image, room, &identity, generation, self, &shape, NULL);
}

pvid_snapshot_status pvid_snapshot_restore_strong_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                                      const uint8_t image[], size_t length)
{
    if (!is_ready(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &shape, NULL);
}
