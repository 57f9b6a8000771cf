/* The settings of an estimator in float32, for all estimators. Private to the core. */
#ifndef PVID_SOLVE_SETTINGS_F32_H
#define PVID_SOLVE_SETTINGS_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/estimator.h"

/* What a setting may be. */
typedef struct {
    float least;
    float most;
    pvid_status status; /* if it is not */
    bool or_zero;       /* or 0 */
} pvid_range_f32;

/* PVID_OK, or the status of the first value that is out of its range. */
pvid_status pvid_settings_within_f32(const float values[], const pvid_range_f32 ranges[], size_t count);

/* Checks every field of a configuration but model and row_weight, for n_p parameters, those of the bits of `positive`
 * being positive. The status names the refused field. */
pvid_status pvid_settings_are_valid_f32(const pvid_estimator_config_f32 *config, size_t n_p, uint32_t positive,
                                        float update_rate_hz);

/* gamma of estimator.h for solves at this interval [groups of rows]. */
float pvid_settings_gain_f32(const pvid_estimator_config_f32 *config, float update_rate_hz, float interval);

/* exp(-x), 0 <= x <= 4: the core has no libm but sqrtf. */
float pvid_settings_decay_f32(float x);

/* The hash of these settings, without those that an identifier fills in, continued from `hash`. */
uint32_t pvid_fingerprint_estimator_f32(uint32_t hash, const pvid_estimator_config_f32 *config, size_t n_p);

#endif
