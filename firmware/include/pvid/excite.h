/* pvid/excite.h - drives a mechanism so that its parameters can be identified, within limits.
 *
 * A drive is a sum of parts (sines, chirps, pseudorandom sequences, steps) from a table, which `pvid deploy` designs
 * for the least standard errors; pvid_excite_rule_f32 makes one without a design. It starts and stops softly, and
 *
 *   - never leaves low..high, never changes by more than slew / sample_rate_hz in a tick, after an abort too;
 *   - is turned back or faded out where a measured signal, or its rate, comes near a limit (soft, a guard);
 *   - falls to 0 and stays there beyond a hard limit, where a measured signal is not finite, and on request.
 *
 *   static pvid_excite_f32 excitation;                                       one for each drive
 *   if (pvid_excite_init_f32(&excitation, &config) != PVID_OK) ...
 *   pvid_excite_start_f32(&excitation, 1.0f, 0u);
 *   each tick:  drive = pvid_excite_step_f32(&excitation, measured);         apply it until the next tick
 *   until:      pvid_excite_state_of_f32(&excitation) == PVID_EXCITE_ENDED
 *
 * Every input is allowed. Call all functions of an object from one context. Identification of what moves then:
 * commission.h. Cost on a Cortex-M4F: about 45 instructions a part, 40 a guard.
 */
#ifndef PVID_EXCITE_H
#define PVID_EXCITE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Most parts and guards of a drive. */
#define PVID_EXCITE_PARTS 16u
#define PVID_EXCITE_GUARDS 6u

/* Largest amplitude, limit and level [any unit]; limits of what is measured. */
#define PVID_EXCITE_MOST 1.0e6f
#define PVID_EXCITE_MOST_MEASURED 1.0e9f

typedef enum {
    PVID_EXCITE_TONE = 0, /* amplitude sin(2 pi (hz t + turns)) */
    PVID_EXCITE_CHIRP,    /* a sine whose frequency rises evenly from hz to to_hz in sweep_s, falls again, and so on */
    PVID_EXCITE_PRBS,     /* amplitude or -amplitude, drawn anew hz times a second: a register of 16 bits */
    PVID_EXCITE_STEPS     /* amplitude level[0], level[1], ..., hz of them a second, over and over */
} pvid_excite_kind;

/* A part of a drive. */
typedef struct {
    pvid_excite_kind kind;
    float amplitude;    /* [unit of the drive], 0..PVID_EXCITE_MOST */
    float hz;           /* [Hz], above 0, up to half the sample rate */
    float turns;        /* phase at the start [turns], 0..1; PRBS: where the sequence begins */
    float to_hz;        /* chirp: hz..half the sample rate [Hz] */
    float sweep_s;      /* chirp: at least a tick, at most 1e6 s */
    const float *level; /* steps: [levels], each -1..1; must outlive the excitation */
    uint8_t levels;     /* steps: 1 or more */
} pvid_excite_part_f32;

/* A soft limit and a hard one of a measured signal. Where the signal is about to go, from soft to hard, the drive that
 * pushes outwards fades to 0, and `push` times the drive's own limit is added inwards, in proportion:
 *
 *   where = x + ahead_s x' + x' |x'| / (2 brake)      a hard limit is one of x itself
 *
 * With ahead_s the time in which the drive can reverse, and brake a deceleration that the pushing drive reaches, no
 * motion that begins within the soft limits reaches a hard one. */
typedef struct {
    uint8_t signal; /* place in `measured` */
    bool of_rate;   /* the limits are of its rate of change; ahead_s and brake are 0 then */
    float low;      /* hard limits [unit, or unit/s], low < soft_low < soft_high < high */
    float soft_low; /* all within -PVID_EXCITE_MOST_MEASURED..PVID_EXCITE_MOST_MEASURED */
    float soft_high;
    float high;
    float response;    /* sign of the motion that a positive drive causes: 1 or -1; 0: unknown, any drive fades */
    float push;        /* 0..1; 0 where response is 0: the drive is held back; 1: turned back with all of it */
    float ahead_s;     /* [s], 0..1e3 */
    float brake;       /* [unit/s^2], 1e-6..1e12; 0: no braking distance */
    float smoothing_s; /* of the rate, which is a difference of samples: time constant of a first-order filter [s],
                          0..1e3; 0: none. It is late by this time: add it to ahead_s */
} pvid_excite_guard_f32;

typedef struct {
    float sample_rate_hz; /* of the calls of step [Hz], 1e-3..1e6 */
    float low;            /* limits of the drive [its unit], low <= 0 <= high, low < high */
    float high;
    float slew;                         /* of the drive, largest change [unit/s], at most 1e12; in a tick at least 1e-6
                                           of the wider limit */
    float ramp_s;                       /* soft start and soft stop, each [s]: at least a tick, at most 1e6 s */
    float burst_s;                      /* between them [s]: at least a tick, at most 1e6 s and 2^31 ticks */
    const pvid_excite_part_f32 *part;   /* [parts]; must outlive the excitation */
    const pvid_excite_guard_f32 *guard; /* [guards], the most important one last; must outlive the excitation */
    uint8_t parts;                      /* 1..PVID_EXCITE_PARTS */
    uint8_t guards;                     /* 0..PVID_EXCITE_GUARDS */
    uint8_t measured;                   /* entries of the argument of step, above each guard's signal */
} pvid_excite_config_f32;

typedef enum {
    PVID_EXCITE_IDLE = 0, /* not started: the drive is 0 */
    PVID_EXCITE_RISING,   /* soft start */
    PVID_EXCITE_RUNNING,  /* the burst */
    PVID_EXCITE_FALLING,  /* soft stop, or the drive falls to 0 after an abort */
    PVID_EXCITE_ENDED     /* the drive is 0 */
} pvid_excite_state;

/* Why it ended, or is about to. */
typedef enum {
    PVID_EXCITE_FINISHED = 0, /* it has not been cut short */
    PVID_EXCITE_HARD_LIMIT,   /* a measured signal, or its rate, was beyond the hard limit of a guard */
    PVID_EXCITE_SENSOR,       /* a guarded signal was not finite, or `measured` was NULL */
    PVID_EXCITE_ASKED         /* pvid_excite_abort_f32 */
} pvid_excite_reason;

/* State: detail/excite_state.h, not API. Only the functions below write to it. */
typedef struct pvid_excite_f32 pvid_excite_f32;

/* Initialises `self`. config and its tables must outlive it. Fails iff a pointer is NULL (PVID_BAD_POINTER) or a field
 * is out of its range (the status names it); the object is not ready then. */
pvid_status pvid_excite_init_f32(pvid_excite_f32 *self, const pvid_excite_config_f32 *config);

/* Begins a burst with `scale` times the amplitudes (0..1; any other number counts as 0) and the phases of run number
 * `run`: another number gives another motion of the same spectrum. Fails iff `self` is not ready or its drive is not 0
 * yet: returns false and changes nothing. */
bool pvid_excite_start_f32(pvid_excite_f32 *self, float scale, uint32_t run);

/* The drive of a tick, to be applied until the next one, from the samples that are measured now [measured]; 0 if `self`
 * is not ready. Work and time do not depend on the data but for few instructions. */
float pvid_excite_step_f32(pvid_excite_f32 *self, const float measured[]);

/* Stops softly. */
void pvid_excite_stop_f32(pvid_excite_f32 *self);

/* Stops at once: the drive falls to 0 at the rate `slew`, whatever is measured. */
void pvid_excite_abort_f32(pvid_excite_f32 *self);

/* What it does; IDLE if `self` is not ready. */
pvid_excite_state pvid_excite_state_of_f32(const pvid_excite_f32 *self);

/* Why it ended; *guard: the one of a hard limit or of a sensor; may be NULL. */
pvid_excite_reason pvid_excite_reason_of_f32(const pvid_excite_f32 *self, uint8_t *guard);

/* Share of the ticks since the start in which a guard, a limit of the drive or its slew rate changed the drive, 0..1.
 */
float pvid_excite_restrained_f32(const pvid_excite_f32 *self);

/* A table by rule: eight sines at whole multiples 1, 2, 3, 5, 8, ... of low_hz, all of them below top_hz, with phases
 * that keep the sum's peak at 0.9 to 1.2 times `amplitude`. Returns the parts written, 0 iff an argument is NULL or out
 * of its range (0 < low_hz < top_hz <= 5e5 Hz, 0 < amplitude <= PVID_EXCITE_MOST). */
uint8_t pvid_excite_rule_f32(pvid_excite_part_f32 part[8], float amplitude, float low_hz, float top_hz);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/excite_state.h"

#endif
