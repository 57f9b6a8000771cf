/* Replaces, for static analysis, the stream_tables.h of an image: declares its settings. */
#ifndef STREAM_TABLES_H
#define STREAM_TABLES_H

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/weak.h"
#include "pvid/weak_q31.h"
#include "stream_rig.h"

#if STREAM_FORM == 0
typedef struct {
    pvid_estimator_config_f32 estimator;
} motor_strong_config_f32;

typedef struct {
    struct {
        pvid_counters counters;
    } estimator;
} motor_strong_f32;

extern const motor_strong_config_f32 motor_strong_config;

pvid_status motor_strong_init_f32(motor_strong_f32 *self, const motor_strong_config_f32 *config);
pvid_reason motor_strong_step_f32(motor_strong_f32 *self, const float sample[STREAM_SAMPLES]);
void motor_strong_assess_f32(const motor_strong_f32 *self, pvid_estimate_f32 *estimate);
/* Of the type of its member without a name. */
#define motor_strong_fnv_f32(hash, estimator, reason) pvid_fnv_word((hash), (estimator)->counters.updates + (reason))
#elif STREAM_CORE == 0
extern const pvid_weak_config_f32 STREAM_CONFIG;
#else
extern const pvid_weak_config_q31 STREAM_CONFIG;
#endif

#endif
