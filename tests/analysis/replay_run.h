/* Stands for the replay_run.h that pvid.board.replay_image makes of a run: settings and samples that are somewhere
 * else. */
#ifndef REPLAY_RUN_H
#define REPLAY_RUN_H

#include "pvid/pvid.h"

#define REPLAY_Q31 (STREAM_CORE == 1)
#define REPLAY_WEAK (STREAM_FORM == 1)
#define REPLAY_FORM "some"
#define REPLAY_TICKS 5000u
#define REPLAY_MEASURE_FROM 1000u
#define REPLAY_REPORT_EVERY 500u
#define REPLAY_MISSING (-32767 - 1)

#if REPLAY_Q31
#define replay_phi_lsb 1
#define replay_y_lsb 1
#else
static const float replay_phi_lsb = 3.8e-4f;
static const float replay_y_lsb = 5.0e-6f;
#endif

extern const int16_t replay_samples[REPLAY_TICKS][2];

#if REPLAY_Q31 && REPLAY_WEAK
extern const pvid_weak_config_q31 replay_config;
#elif REPLAY_Q31
extern const pvid_strong_config_q31 replay_config;
#elif REPLAY_WEAK
extern const pvid_weak_config_f32 replay_config;
#else
extern const pvid_strong_config_f32 replay_config;
#endif

#endif
