/* Replaces, for static analysis, the stream_rig.h that pvid.board.stream_image makes of a rig file. tools/units.py
 * defines core and form. */
#ifndef STREAM_RIG_H
#define STREAM_RIG_H

#if STREAM_FORM == 2
#define STREAM_CONFIG motor_config_f32
#elif STREAM_CORE == 1
#define STREAM_TYPE pvid_strong_q31
#define STREAM_CONFIG pvid_strong_config_q31
#define STREAM_INIT pvid_strong_init_q31
#define STREAM_STEP pvid_strong_step_q31
#else
#define STREAM_TYPE pvid_strong_f32
#define STREAM_CONFIG pvid_strong_config_f32
#define STREAM_INIT pvid_strong_init_f32
#define STREAM_STEP pvid_strong_step_f32
#endif
#if STREAM_CORE == 1
#define STREAM_HASH pvid_fnv_strong_q31
#define STREAM_ASSESS pvid_kapitza_estimator_assess_q31
#define STREAM_ASSESSED identifier.estimator
#else
#define STREAM_HASH pvid_fnv_strong_f32
#define STREAM_ASSESS pvid_strong_assess_f32
#define STREAM_ASSESSED identifier
#endif

#define STREAM_SETTINGS 0x12345678u
#define STREAM_N_P 4u
#define STREAM_SAMPLES 2u
#define STREAM_NAMES "motor\nsample V V\nsample i A\np R ohm"
#define STREAM_SAMPLE_RATE 1000.0f
#define STREAM_PHI_LSB 3.8e-4f
#define STREAM_Y_LSB 5.0e-6f
#define STREAM_PHI 0u
#define STREAM_Y 1u
#define STREAM_LSB {STREAM_PHI_LSB, STREAM_Y_LSB}
#define STREAM_P_UNIT {1.0f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f}
#define STREAM_SENSOR_CONSTANTS                                                                                        \
    {                                                                                                                  \
        .steps = 8u, .step_squared = 1.0e-8f, .w = 30.0f, .ratio2 = 2.0f, .coupling = 1.0f, .phi1 = 0.1f, .phi = 0.1f, \
        .counts_per_rad = 2600.0f, .counts_per_m = 2.0e5f,                                                             \
        .tones = {{0.0f, 0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}}                        \
    }

#endif
