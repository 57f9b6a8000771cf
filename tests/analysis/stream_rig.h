/* Replaces, for static analysis, the stream_rig.h that pvid.board makes of a rig. tools/units.py defines core and form.
 */
#ifndef STREAM_RIG_H
#define STREAM_RIG_H

#if STREAM_FORM == 0 /* the strong form */
#define STREAM_TYPE motor_strong_f32
#define STREAM_CONFIG_TYPE motor_strong_config_f32
#define STREAM_CONFIG motor_strong_config
#define STREAM_NAME(verb) motor_strong_##verb##_f32
#elif STREAM_CORE == 0
#define STREAM_CONFIG motor_config_f32
#else
#define STREAM_CONFIG motor_config_q31
#endif

#define STREAM_SETTINGS 0x12345678u
#define STREAM_N_P 4u
#define STREAM_SAMPLES 2u
#define STREAM_NAMES "motor\nsample V V\nsample i A\np R ohm"
#define STREAM_SAMPLE_RATE 1000.0f
#define STREAM_PHI_LSB 0.0f
#define STREAM_Y_LSB 0.0f
#define STREAM_LSB {3.8e-4f, 5.0e-6f}
#define STREAM_P_UNIT {1.0f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f}

#endif
