/* Replaces, for static analysis, the replay_run.h that pvid.board.replay_image makes of a run: declares its settings
 * and samples. */
#ifndef REPLAY_RUN_H
#define REPLAY_RUN_H

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "stream_rig.h"

#define REPLAY_TYPE STREAM_TYPE
#define REPLAY_INIT STREAM_INIT
#define REPLAY_STEP(self, sample) STREAM_STEP(self, (sample)[0], (sample)[1])
#define REPLAY_COUNT int16_t
#define REPLAY_CHANNELS 2u
#define REPLAY_HASH STREAM_HASH
#define REPLAY_IS_FLOAT (STREAM_CORE == 0)
#define REPLAY_FORM "some"
#define REPLAY_TICKS 5000u
#define REPLAY_MEASURE_FROM 1000u
#define REPLAY_REPORT_EVERY 500u
#define REPLAY_MISSING (-32767 - 1)

#if REPLAY_IS_FLOAT
#define REPLAY_SAMPLE float
#define REPLAY_FAULTS pvid_arithmetic_faults_f32()
static const float replay_lsb[REPLAY_CHANNELS] = {3.8e-4f, 5.0e-6f};
#else
#define REPLAY_SAMPLE int32_t
#define REPLAY_FAULTS 0u
static const int32_t replay_lsb[REPLAY_CHANNELS] = {1, 1};
#endif

extern const REPLAY_COUNT replay_samples[REPLAY_TICKS][REPLAY_CHANNELS];

extern const STREAM_CONFIG replay_config;

#endif
