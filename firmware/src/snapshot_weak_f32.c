#include <stddef.h>
#include <string.h>

#include "fingerprint_f32.h"
#include "snapshot.h"

#define PLACE(field) ((uint32_t)offsetof(pvid_weak_f32, field))

static const uint32_t layout[] = {
    sizeof(pvid_weak_f32),
    sizeof(pvid_weak_angle_f32),
    sizeof(void *),
    PLACE(dt),
    PLACE(phi),
    PLACE(front),
    PLACE(front.ring),
    PLACE(bend),
    PLACE(window),
    PLACE(finish),
    PLACE(finish.whiten),
    PLACE(finish.solve),
    PLACE(finish.solve.sums),
    PLACE(finish.solve.factor),
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
    (uint32_t)offsetof(pvid_weak_angle_f32, lack),
    (uint32_t)offsetof(pvid_weak_angle_f32, ring),
    PVID_MAX_P,
    PVID_MAX_THETA,
    PVID_MAX_MOMENTS,
    PVID_MAX_TAPS,
    PVID_MAX_DECIMATION,
    PVID_MAX_FUNCTIONS,
    PVID_MAX_WEAK_WINDOW,
};

/* The windows of the full-angle correction stand outside the identifier, and behind it in a snapshot. */
static bool has_angle(const pvid_weak_config_f32 *config)
{
    return config->full_angle || config->friction;
}

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

size_t pvid_snapshot_save_weak_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                   uint8_t image[], size_t room)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (image != NULL) && (self->design == config->design));
    if (room < (has_angle(config) ? PVID_SNAPSHOT_WEAK_ANGLE_F32 : PVID_SNAPSHOT_WEAK_F32)) {
        return 0;
    }
    uint8_t *object = &image[PVID_SNAPSHOT_HEADER];
    memcpy(object, self, sizeof *self);
    pvid_snapshot_put_pointer(object, PLACE(design), self->design);
    pvid_snapshot_put_pointer(object, PLACE(angle), self->angle);
    pvid_snapshot_put_pointer(object, PLACE(front.smooth), self->front.smooth);
    pvid_snapshot_put_pointer(object, PLACE(front.second), self->front.second);
    pvid_snapshot_put_pointer(object, PLACE(finish.angle), self->finish.angle);
    pvid_snapshot_put_pointer(object, PLACE(finish.solve.refuge), self->finish.solve.refuge);
    pvid_snapshot_put_pointer(object, PLACE(finish.solve.estimate), self->finish.solve.estimate);
    pvid_snapshot_put_pointer(object, PLACE(estimator.model), self->estimator.model);
    if (has_angle(config)) {
        memcpy(&object[sizeof *self], self->angle, sizeof *self->angle);
    }
    const pvid_snapshot_identity identity = identity_of(config);
    return pvid_snapshot_seal(image, &identity, generation);
}

/* The object's bytes, and what init had bound it to; what pointed into the object points into it again. */
static void put_back(pvid_weak_f32 *self, const uint8_t object[])
{
    const pvid_weak_design_f32 *design = self->design;
    pvid_weak_angle_f32 *angle = self->angle;
    const pvid_model_f32 *model = self->estimator.model;
    memcpy(self, object, sizeof *self);
    self->design = design;
    self->angle = angle;
    self->front.smooth = design->smooth;
    self->front.second = design->second;
    self->finish.angle = pvid_snapshot_had_pointer(object, PLACE(finish.angle)) ? angle : NULL;
    self->finish.solve.refuge =
        pvid_snapshot_had_pointer(object, PLACE(finish.solve.refuge)) ? self->trust.estimate.p : NULL;
    self->finish.solve.estimate =
        pvid_snapshot_had_pointer(object, PLACE(finish.solve.estimate)) ? &self->finish.candidate : NULL;
    self->estimator.model = model;
}

pvid_snapshot_status pvid_snapshot_restore_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                    const uint8_t image[], size_t length)
{
    PVID_ASSERT((self != NULL) && (config != NULL) && (image != NULL) && (self->design == config->design));
    const pvid_snapshot_identity identity = identity_of(config);
    const pvid_snapshot_status status = pvid_snapshot_inspect(image, length, &identity);
    if (status == PVID_SNAPSHOT_RESTORED) {
        const uint8_t *object = &image[PVID_SNAPSHOT_HEADER];
        put_back(self, object);
        if (has_angle(config)) {
            memcpy(self->angle, &object[sizeof *self], sizeof *self->angle);
        }
    }
    return status;
}
