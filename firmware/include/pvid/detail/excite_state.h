/* pvid/detail/excite_state.h - the state behind excite.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_EXCITE_STATE_H
#define PVID_DETAIL_EXCITE_STATE_H

#include "pvid/excite.h"

/* Of a part. */
typedef struct {
    uint32_t phase;   /* 2^32 is a turn; of a sequence it wraps once a level */
    uint32_t advance; /* of the phase in a tick, at most 2^31 */
    float hz;         /* chirp: present frequency [Hz] */
    float slope;      /* chirp: its change in a tick [Hz] */
    uint16_t place;   /* PRBS: the register, never 0; steps: the level */
} pvid_excite_wave_f32;

/* Of a guard. */
typedef struct {
    float last; /* sample of the previous tick */
    float rate; /* smoothed [unit/s] */
    bool seen;  /* there is a previous tick */
} pvid_excite_track_f32;

/* Only the functions of excite.h write to it. */
struct pvid_excite_f32 {
    const pvid_excite_config_f32 *config; /* NULL: not ready */
    uint32_t ramp_ticks;
    uint32_t burst_ticks;
    float slew;       /* in a tick */
    float per_ramp;   /* 1 / ramp_ticks */
    float turn;       /* advance of the phase per Hz */
    float scale;      /* of the amplitudes */
    float drive;      /* of the last tick */
    uint32_t level;   /* of the envelope, 0..ramp_ticks */
    uint32_t left;    /* ticks of the burst; behind the soft stop: ticks with guards */
    uint32_t ticks;   /* since the start; stops at 2^32 - 1 */
    uint32_t touched; /* of these, with a drive that was changed */
    pvid_excite_state state;
    pvid_excite_reason reason;
    uint8_t at; /* guard of the reason */
    pvid_excite_wave_f32 wave[PVID_EXCITE_PARTS];
    pvid_excite_track_f32 track[PVID_EXCITE_GUARDS];
};

#endif
