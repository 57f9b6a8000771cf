#include <stdbool.h>
#include <stddef.h>

#include "persist/fingerprint_q31.h"
#include "persist/snapshot.h"
#include "pvid/snapshot_q31.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_strong_q31, field))

static const uint32_t layout[] = {
    sizeof(pvid_strong_q31),
    sizeof(void *),
    PLACE(differentiator.missing),
    PLACE(differentiator.history),
    PLACE(row),
    PLACE(drive),
    PLACE(gate),
    PLACE(misfit),
    PLACE(misfit.block),
    PLACE(estimator),
    PLACE(estimator.sums),
    PLACE(estimator.p),
    PLACE(estimator.fresh),
    PLACE(estimator.counters),
    PVID_MAX_WINDOW,
    PVID_MAX_P,
};

static const pvid_snapshot_pointer pointers[] = {{PLACE(differentiator.bank.weights), PVID_SNAPSHOT_OF_INIT}};
static const pvid_snapshot_shape shape = {sizeof(pvid_strong_q31), pointers, sizeof pointers / sizeof pointers[0]};

static pvid_snapshot_identity identity_of(const pvid_strong_config_q31 *config)
{
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_STRONG_Q31,
        .layout = pvid_snapshot_layout(layout, sizeof layout / sizeof layout[0]),
        .config = pvid_fingerprint_strong_q31(config),
        .bytes = sizeof(pvid_strong_q31),
    };
    return identity;
}

/* Whether init has accepted a configuration. */
static bool is_ready(const pvid_strong_q31 *self, const pvid_strong_config_q31 *config, const uint8_t image[])
{
    const bool ready = (self != NULL) && (config != NULL) && (image != NULL) && self->estimator.ready;
    PVID_ASSERT(ready);
    return ready;
}

size_t pvid_snapshot_save_strong_q31(const pvid_strong_q31 *self, const pvid_strong_config_q31 *config,
                                     uint32_t generation, uint8_t image[], size_t room)
{
    if (!is_ready(self, config, image)) {
        return 0;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_save(image, room, &identity, generation, self, &shape, NULL);
}

pvid_snapshot_status pvid_snapshot_restore_strong_q31(pvid_strong_q31 *self, const pvid_strong_config_q31 *config,
                                                      const uint8_t image[], size_t length)
{
    if (!is_ready(self, config, image)) {
        return PVID_SNAPSHOT_NOT_READY;
    }
    const pvid_snapshot_identity identity = identity_of(config);
    const pvid_snapshot_status status = pvid_snapshot_restore(image, length, &identity, (uint8_t *)self, &shape, NULL);
    self->estimator.ready = true; /* as it was, whatever the bytes say */
    return status;
}
