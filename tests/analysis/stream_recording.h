/* Replaces, for static analysis, the stream_recording.h that pvid.board.mechanism_board makes: declares its samples. */
#ifndef STREAM_RECORDING_H
#define STREAM_RECORDING_H

#include "stream_rig.h"

#define RECORDED_TICKS 1000u
#define STREAM_PUT pvid_put_f32

extern const float recorded[RECORDED_TICKS][STREAM_SAMPLES];

#endif
