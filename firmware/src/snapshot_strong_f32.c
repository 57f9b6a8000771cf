#include <stddef.h>
#include <string.h>

#include "fingerprint_f32.h"
#include "snapshot.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_strong_f32, field))

static const uint32_t layout[] = {
    sizeof(pvid_strong_f32), sizeof(void *),
    PLACE(phi.rate_power),   PLACE(phi.history),
    PLACE(y),                PLACE(drive),
    PLACE(estimator),        PLACE(estimator.information.low),
    PLACE(estimator.p),      PLACE(estimator.innovation),
    PLACE(estimator.gain),   PLACE(estimator.counters),
    PVID_MAX_WINDOW,         PVID_MAX_P,
    PVID_MAX_THETA,          PVID_MAX_MOMENTS,
};

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

size_t pvid_snapshot_save_strong_f32(const pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                     uint32_t generation, uint8_t image[], size_t room)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (image != NULL));
    if (room < PVID_SNAPSHOT_STRONG_F32) {
        return 0;
    }
    uint8_t *object = &image[PVID_SNAPSHOT_HEADER];
    memcpy(object, self, sizeof *self);
    pvid_snapshot_put_pointer(object, PLACE(phi.bank.weights), self->phi.bank.weights);
    pvid_snapshot_put_pointer(object, PLACE(y.bank.weights), self->y.bank.weights);
    pvid_snapshot_put_pointer(object, PLACE(estimator.model), self->estimator.model);
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_seal(image, &identity, generation);
}

pvid_snapshot_status pvid_snapshot_restore_strong_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                                      const uint8_t image[], size_t length)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (image != NULL));
    const pvid_snapshot_identity identity = identity_of(config);
    const pvid_snapshot_status status = pvid_snapshot_inspect(image, length, &identity);
    if (status == PVID_SNAPSHOT_RESTORED) {
        const float *weights = self->phi.bank.weights;
        const pvid_model_f32 *model = self->estimator.model;
        memcpy(self, &image[PVID_SNAPSHOT_HEADER], sizeof *self);
        self->phi.bank.weights = weights;
        self->y.bank.weights = weights;
        self->estimator.model = model;
    }
    return status;
}
