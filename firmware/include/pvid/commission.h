/* pvid/commission.h - commissions a mechanism: excites it, identifies it, checks the values on fresh motion, stops.
 *
 *   static pvid_commission_f32 commission;
 *   if (pvid_commission_init_f32(&commission, &config) != PVID_OK) ...     config: printed by `pvid deploy`
 *   pvid_commission_start_f32(&commission);
 *   each tick:       pvid_commission_step_f32(&commission, sample, drive);      apply the drives until the next tick
 *   main loop:       while (pvid_commission_work_f32(&commission)) ...          one sample of the identifier a call
 *   until state:     PVID_COMMISSION_ENDED; then pvid_commission_result_of_f32(&commission)
 *
 * The order of events: a burst (excite.h) whose samples go to a ring; passes over it by the identifier (weak.h), in the
 * background, so that the tick itself may be far shorter than a step of the identifier; a second burst of another size
 * and other phases, identified from the first one's values with sums of its own. Both estimates must agree, and both
 * must fit. The drives are 0 between the bursts and after the end.
 *
 * A ring that holds a whole burst allows several passes, each of which starts at the estimate of the one before. A
 * shorter ring is a queue: one pass, while the burst lasts, and work must keep up with the ticks.
 *
 * step belongs to one context, an interrupt for instance; all other functions to one other, the main loop; or all to
 * one. No function waits. Every input is allowed.
 */
#ifndef PVID_COMMISSION_H
#define PVID_COMMISSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/excite.h"
#include "pvid/weak.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Most drives of a mechanism. */
#define PVID_COMMISSION_DRIVES 4u

/* Where a drive does not appear among the samples: it is the command of a signal that is measured itself. */
#define PVID_COMMISSION_NOWHERE 255u

typedef struct {
    const pvid_weak_config_f32 *weak;     /* settings of the identifier */
    pvid_weak_f32 *identifier;            /* its storage; the commissioning calls its init */
    const pvid_excite_config_f32 *excite; /* [drives] `measured`: number of samples, all with one sample rate */
    pvid_excite_f32 *excitation;          /* [drives] storage */
    const uint8_t *input; /* [drives] place of each drive among the samples, or PVID_COMMISSION_NOWHERE */
    uint8_t drives;       /* 0..PVID_COMMISSION_DRIVES; 0: the caller moves the mechanism, and start begins a burst */
    uint8_t passes;       /* over a burst, 1..8; above 1 the ring holds burst_ticks */
    float *ring;          /* [ring_ticks * samples] storage */
    uint32_t ring_ticks;  /* 2..2^24 */
    uint32_t burst_ticks; /* samples of a burst, 2..2^24; each excitation's burst is at least as long, and all
                             have one ramp_s */
    float check_scale;    /* amplitude of the second burst over that of the first, 0.2..1 */
    float agree;          /* largest difference of both estimates [joint standard errors], 3..100 */
    float misfit_max;     /* largest residual variance of a burst over its expectation, 1..100 */
    float restrained_max; /* share of the ticks in which limits changed the drive, above which too little information
                             is blamed on them, 0..1 */
    /* All tables and storages must outlive the commissioning. */
} pvid_commission_config_f32;

typedef enum {
    PVID_COMMISSION_IDLE = 0, /* not started */
    PVID_COMMISSION_BURST,    /* the first burst */
    PVID_COMMISSION_SOLVE,    /* drives 0: work passes over it */
    PVID_COMMISSION_CHECK,    /* the second burst */
    PVID_COMMISSION_COMPARE,  /* drives 0: work passes over that */
    PVID_COMMISSION_ENDED     /* drives 0: there is a result */
} pvid_commission_state;

typedef enum {
    PVID_COMMISSION_PENDING = 0,  /* no result yet */
    PVID_COMMISSION_DONE,         /* both bursts fit, their values agree */
    PVID_COMMISSION_ABORTED,      /* `reason` and `guard` are those of the excitation; values: none */
    PVID_COMMISSION_NOT_EXCITED,  /* the motion does not determine all parameters well enough */
    PVID_COMMISSION_DOES_NOT_FIT, /* residuals too large, or the second burst gives other values: `parameter` */
    PVID_COMMISSION_TOO_TIGHT,    /* not excited, while limits changed the drive in most ticks */
    PVID_COMMISSION_TOO_SLOW      /* the ring was full before work took its samples */
} pvid_commission_verdict;

typedef struct {
    pvid_commission_verdict verdict;
    pvid_excite_reason reason; /* of PVID_COMMISSION_ABORTED */
    uint8_t drive;             /* the drive of `reason` */
    uint8_t guard;             /* and its guard */
    uint8_t parameter;         /* of the largest difference */
    float value[PVID_MAX_P]; /* identified from the first burst [units of p]; to be used with the verdict DONE alone */
    float error[PVID_MAX_P]; /* standard errors of these */
    float check[PVID_MAX_P]; /* identified from the second burst */
    float difference;        /* largest one of both estimates [joint standard errors] */
    float misfit[2];         /* of each burst: residual variance over its expectation; 0: unknown */
    pvid_reason outcome[2];  /* of each burst: the identifier's last reason that was not PVID_ACCUMULATED */
    float restrained;        /* share of the ticks of the last burst in which limits changed a drive, 0..1 */
} pvid_commission_result_f32;

/* State: detail/commission_state.h, not API. Only the functions below write to it. */
typedef struct pvid_commission_f32 pvid_commission_f32;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_commission_init_layout_f32(pvid_commission_f32 *self, const pvid_commission_config_f32 *config,
                                            uint32_t layout);

/* Initialises `self`, its excitations and its identifier. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; nothing is written),
 *   - a field of config is out of its range (the status names it), or
 *   - the init of an excitation or of the identifier fails, with its status. */
static inline pvid_status pvid_commission_init_f32(pvid_commission_f32 *self, const pvid_commission_config_f32 *config)
{
    return pvid_commission_init_layout_f32(self, config, PVID_LAYOUT);
}

/* Begins, or begins anew after an end. Fails iff `self` is not ready or at work: returns false, changes nothing. */
bool pvid_commission_start_f32(pvid_commission_f32 *self);

/* A tick: from the samples that are measured now [samples of weak.h; those of `input` are ignored] the drives [drives],
 * to be applied until the next tick; all 0 outside bursts. `drive` may be NULL iff there are no drives. Cost: a step of
 * each excitation and a copy of the samples; never a step of the identifier. */
pvid_commission_state pvid_commission_step_f32(pvid_commission_f32 *self, const float sample[], float drive[]);

/* Background work: at most one step of the identifier, or its init. Returns whether there may be more at once. */
bool pvid_commission_work_f32(pvid_commission_f32 *self);

/* Ends it: the drives fall to 0 at their slew rates. Allowed in any context. */
void pvid_commission_abort_f32(pvid_commission_f32 *self);

/* The state; IDLE if `self` is not ready. */
pvid_commission_state pvid_commission_state_of_f32(const pvid_commission_f32 *self);

/* The result; its verdict is PENDING before the end. NULL iff `self` is NULL. */
const pvid_commission_result_f32 *pvid_commission_result_of_f32(const pvid_commission_f32 *self);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/commission_state.h"

#endif
