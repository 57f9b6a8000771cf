/* Stands for the stream_rig.h that pvid.board.stream_image makes of a rig file, where an application is read and not
 * run: tools/units.py says core and form. */
#ifndef STREAM_RIG_H
#define STREAM_RIG_H

#define STREAM_SETTINGS 0x12345678u
#define STREAM_N_P 4u
#define STREAM_SAMPLE_RATE 1000.0f
#define STREAM_PHI_LSB 3.8e-4f
#define STREAM_Y_LSB 5.0e-6f
#define STREAM_P_UNIT {1.0f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f}
#define STREAM_SENSOR_CONSTANTS                                                                                        \
    {                                                                                                                  \
        .steps = 8u, .step_squared = 1.0e-8f, .w = 30.0f, .ratio2 = 2.0f, .coupling = 1.0f, .phi1 = 0.1f, .phi = 0.1f, \
        .counts_per_rad = 2600.0f, .counts_per_m = 2.0e5f,                                                             \
        .tones = {{0.0f, 0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}}                        \
    }

#endif
