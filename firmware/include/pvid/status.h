/* pvid/status.h - statuses of init, reason codes of a tick, counters and laws, for both cores. */
#ifndef PVID_STATUS_H
#define PVID_STATUS_H

#include <stdint.h>

/* Result of every init: the refused field of the configuration. After a refused init the object is all zeros
 * (after PVID_BAD_LAYOUT unchanged), like a static object before its init: step returns PVID_NOT_READY and all other
 * functions do nothing. (An automatic variable before its init is not zero; this misuse is not detected.) */
typedef enum {
    PVID_OK = 0,
    PVID_BAD_MODEL,         /* NULL, larger than the PVID_MAX_ bounds, or its kinds do not divide theta */
    PVID_BAD_SAMPLE_RATE,   /* not finite or outside 1e-3..1e6 Hz */
    PVID_BAD_BANK,          /* weights of a bank: NULL, or one that is not finite */
    PVID_BAD_START,         /* start not finite, not positive for a positive parameter, or out of bounds */
    PVID_BAD_START_SD,      /* not finite or not positive */
    PVID_BAD_BOUNDS,        /* not finite, lower >= upper, or lower <= 0 for a positive parameter */
    PVID_BAD_ROW_SD,        /* not finite or not positive */
    PVID_BAD_UPDATE_RATE,   /* not finite or outside 1e-6..1e6 Hz */
    PVID_BAD_FORGETTING,    /* not finite, negative, or shorter than 4 updates */
    PVID_BAD_FEEDBACK,      /* not finite or negative */
    PVID_BAD_LAW,           /* not one of pvid_law */
    PVID_BAD_DIVIDER,       /* 0 */
    PVID_BAD_STEP_LIMIT,    /* not finite or outside (0, 0.9] */
    PVID_BAD_KAPPA_MIN,     /* not finite or outside [0, 1) */
    PVID_BAD_CORRELATION,   /* not finite or below 1 */
    PVID_BAD_DRIVE_MIN,     /* not finite or negative; q31: or too large */
    PVID_BAD_ROW_WEIGHT,    /* not finite or outside (0, 1] */
    PVID_BAD_DESIGN,        /* the design or a table is NULL, or a table is not finite or could overflow */
    PVID_BAD_ITERATIONS,    /* outside 1..PVID_MAX_ITERATIONS, or too many for the window's hop */
    PVID_BAD_NOISE_MARGIN,  /* not finite or outside 0..1e6 */
    PVID_BAD_PUBLISH_KAPPA, /* kappa_min of trust.h not finite or outside [0, 1) */
    PVID_BAD_SE_MAX,        /* not finite or not positive */
    PVID_BAD_MISFIT_MAX,    /* not finite, or neither 0 nor at least 1 */
    PVID_BAD_RANGE,         /* range of a signal: not finite or not positive */
    PVID_BAD_GATE_SIGMAS,   /* not finite, or neither 0 nor 2..1e3 */
    PVID_BAD_GATE_PATIENCE, /* not finite or outside 0..1e12 s */
    PVID_BAD_DEAD_ZONE,     /* not finite or outside 0..100 */
    PVID_BAD_HALF,          /* of a bank: below 2, or a window over PVID_MAX_WINDOW for every stride */
    PVID_BAD_STRIDE,        /* of a bank: 0, or a window with its block over PVID_MAX_WINDOW */
    PVID_BAD_CENTRE,        /* of a q31 bank: outside 1..2^30 */
    PVID_BAD_TAPS,          /* filters of a design: longer than PVID_MAX_RING holds */
    PVID_BAD_DECIMATION,    /* of a design: outside 1..PVID_MAX_DECIMATION */
    PVID_BAD_WINDOW,        /* hop of a design: too short for its work, or too long */
    PVID_BAD_FUNCTIONS,     /* of a design: outside 4..PVID_MAX_FUNCTIONS */
    PVID_BAD_OVERLAP,       /* of a design: not finite or below 1 */
    PVID_BAD_FULL_SCALE,    /* of a sensor of a q31 form: not positive, too large, or too large for the weights */
    PVID_BAD_SHIFT,         /* of a q31 design: beyond 64 bits, or too small for full scale */
    PVID_BAD_DRIVE_TICKS,   /* rows_per_second of a q31 strong form: outside 1..2^30 */
    PVID_BAD_FORMAT,        /* p_bits, n_bits or y_bits of a q31 estimator: outside -64..64 */
    PVID_BAD_RENEWAL,       /* of trust.h: not finite, or neither 0 nor 0.01..1e3 */
    PVID_BAD_SHARED,        /* of trust.h: a standard deviation or correlation out of its range */
    PVID_BAD_POINTER,       /* the object, the configuration or the bank is NULL */
    PVID_BAD_LAYOUT, /* library and application were compiled with different sizes: layout.h; nothing was written */
    PVID_BAD_EXCITE_PARTS,     /* of an excitation: none or too many, an unknown kind, or steps without levels */
    PVID_BAD_EXCITE_AMPLITUDE, /* of a part: not finite or outside 0..1e6; a level outside -1..1 */
    PVID_BAD_EXCITE_FREQUENCY, /* of a part: not finite, not positive, above half the sample rate, or a phase or a sweep
                                  out of its range */
    PVID_BAD_EXCITE_LIMIT,     /* of a drive: not finite, beyond 1e6, or not low <= 0 <= high with low < high */
    PVID_BAD_EXCITE_SLEW,      /* of a drive: not finite, above 1e12, or below 1e-6 of the wider limit in a tick */
    PVID_BAD_EXCITE_TIME,      /* ramp_s or burst_s: not finite, below a tick, above 1e6 s or 2.1e9 ticks */
    PVID_BAD_EXCITE_GUARD,     /* too many, NULL, not low < soft_low < soft_high < high, or a field out of its range */
    PVID_BAD_COMMISSION_DRIVES, /* too many, of unequal ramps or rates, a burst that is too short, or no such sample */
    PVID_BAD_COMMISSION_RING,   /* ring, burst or passes out of range, or a ring too short for several passes */
    PVID_BAD_COMMISSION_CHECK   /* check_scale, agree, misfit_max or restrained_max out of its range */
} pvid_status;

/* Result of a tick. Every estimate is reported together with one of these. */
typedef enum {
    PVID_UPDATED = 0,         /* p was updated, or is within the dead zone */
    PVID_WARMING_UP,          /* the window of samples is not full yet */
    PVID_ACCUMULATED,         /* data added, no solve due at this tick (divider) */
    PVID_HELD_NOT_EXCITED,    /* insufficient excitation: no drive, kappa of p[0] or the least pivot of any parameter
                                 below kappa_min, or no more information than noise gives */
    PVID_HELD_SINGULAR,       /* the system could not be solved, or its solution was not finite */
    PVID_REJECTED_NOT_FINITE, /* NaN or infinity in the sample or in its row */
    PVID_REJECTED_OUTLIER,    /* a residual far beyond the usual size: gate.h */
    PVID_REJECTED_SATURATED,  /* a row beyond PVID_ROW_LIMIT */
    PVID_HELD_UNCERTAIN,      /* not published: too large errors, too few windows, or p still moving: trust.h */
    PVID_HELD_OUT_OF_RANGE,   /* window dropped: a sample exceeded its range */
    PVID_MISFIT, /* p was updated, but the residuals exceed the sensors' noise: the model does not fit the mechanism */
    PVID_HELD_FROZEN, /* row or window not used: the identifier is frozen */
    PVID_NOT_READY,   /* not initialised, init refused, NULL instead of an object, or a kind of rows that the model does
                         not have: nothing was done */
    PVID_HELD_SEARCHING, /* refinement: no block fits the equations yet */
    PVID_HELD_BLOCK,     /* refinement: the block does not fit, or contradicts the blocks before it */
    PVID_HELD_DISAGREES  /* refinement: the estimate differs from the weak form's by more than the errors of both */
} pvid_reason;

/* The law by which an estimator moves p; see estimator.h. */
typedef enum {
    PVID_LAW_STATIONARY = 0, /* with the feedback of F: converges to the least-squares estimate */
    PVID_LAW_PSEUDOVELOCITY  /* equation (5) alone */
} pvid_law;

/* Event counts since init. */
typedef struct {
    uint32_t rows;    /* rows added */
    uint32_t updates; /* steps of p */
    uint32_t limited; /* of those, shortened to step_limit */
    uint32_t bounded; /* of those, with a parameter at its bound */
    uint32_t held_not_excited;
    uint32_t held_singular;
    uint32_t rejected_not_finite;
    uint32_t rejected_saturated;
    uint32_t held_uncertain;    /* groups without publication, see trust.h */
    uint32_t held_out_of_range; /* windows dropped for their range */
    uint32_t misfits;           /* groups published, or updates reported, during the misfit alarm */
    uint32_t rejected_outlier;  /* rows or windows rejected by the gate */
    uint32_t in_dead_zone;      /* solves within the dead zone: p unchanged */
} pvid_counters;                /* each stops at 2^32 - 1 */

#endif
