/* What a snapshot with a second stage needs of that of the weak form. Private to the core. */
#ifndef PVID_SNAPSHOT_WEAK_F32_H
#define PVID_SNAPSHOT_WEAK_F32_H

#include <stdbool.h>

#include "persist/snapshot.h"
#include "pvid/weak.h"

extern const pvid_snapshot_shape pvid_snapshot_weak_shape_f32;

pvid_snapshot_identity pvid_snapshot_weak_identity_f32(const pvid_weak_config_f32 *config);

/* Whether init has accepted this configuration. */
bool pvid_snapshot_weak_is_ready_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                     const uint8_t image[]);

#endif
