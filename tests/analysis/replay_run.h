/* Replaces, for static analysis, the replay_run.h that pvid.board makes of a run: declares its settings and samples. */
#ifndef REPLAY_RUN_H
#define REPLAY_RUN_H

#include "pvid/fnv.h"
#include "pvid/fnv_q31.h"
#include "stream_tables.h"

#define REPLAY_COUNT int16_t
#define REPLAY_CHANNELS 2u
#define REPLAY_IS_FLOAT (STREAM_CORE == 0)
#define REPLAY_FORM "some"
#define REPLAY_TICKS 5000u
#define REPLAY_MEASURE_FROM 1000u
#define REPLAY_REPORT_EVERY 500u
#define REPLAY_MISSING (-32767 - 1)

#if REPLAY_IS_FLOAT
#define REPLAY_TYPE pvid_weak_f32
#define REPLAY_INIT pvid_weak_init_f32
#define REPLAY_STEP pvid_weak_step_f32
#define REPLAY_HASH pvid_fnv_estimator_f32
#define replay_config motor_config_f32
#define REPLAY_SAMPLE float
#define REPLAY_FAULTS pvid_arithmetic_faults_f32()
static const float replay_lsb[REPLAY_CHANNELS] = {3.8e-4f, 5.0e-6f};
#else
#define REPLAY_TYPE pvid_weak_q31
#define REPLAY_INIT pvid_weak_init_q31
#define REPLAY_STEP pvid_weak_step_q31
#define REPLAY_HASH pvid_fnv_estimator_q31
#define replay_config motor_config_q31
#define REPLAY_SAMPLE int32_t
#define REPLAY_FAULTS 0u
static const int32_t replay_lsb[REPLAY_CHANNELS] = {1, 1};
#endif

extern const REPLAY_COUNT replay_samples[REPLAY_TICKS][REPLAY_CHANNELS];

#endif
