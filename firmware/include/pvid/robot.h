/* pvid/robot.h - identifies the base parameters of a robot, up to 64, from the positions and torques of its joints.
 *
 * The torques of rigid bodies are tau_i = d/dt p_i - g_i + friction: momenta p_i and forces g_i are linear in the base
 * parameters and contain no acceleration. A generated function (`pvid model build` of a robot) computes their columns
 * from positions q, rates v and signs of v. Multiplied by a test function B, a cubic B-spline, they give rows
 *
 *   sum_k (-B'(t_k) p_i(t_k) - B(t_k) g_i(t_k) + B(t_k) friction(t_k)) = sum_k B(t_k) tau_i(t_k)
 *
 * A new spline begins at each knot, so that a joint has one row for each interval between knots. Splines that overlap
 * share noise: the recursion u_k = w_0 x_k + w_1 u_(k-1) + w_2 u_(k-2) + w_3 u_(k-3) makes that of white torques white.
 * Of each joint i, columns that it has alone: S_i = sum u u^T, F_i = sum u e and Q_i = sum e^2 of e = y - u p. A group
 * of rows ends with (sum_i S_i / s_i^2 + prior) dp = sum_i F_i / s_i^2 + prior, s_i^2 = Q_i / (rows_i - p / n), by
 * Cholesky, a row of the factor each tick. Then F_i -= S_i dp and Q_i follow p: rounding of S_i acts on dp alone. Where
 * Q_i falls below 2^-10 of itself the joint's sums begin again at the new p. No window of samples is kept.
 *
 * Noise of the encoders is in the columns, too: a part d of a row adds d d^T to S and moves F by -d (d p) in the mean.
 * As much noise is therefore added again, from a table of one period. What that changes in a row is such a d: with
 * D_i = sum d d^T the equation is A dp = sum_i (F_i + D_i p) / s_i^2 + prior, A = sum_i (S_i - D_i) / s_i^2 + prior.
 * Of a column with a share, as a friction that reverses, D_i p has that share alone: it settles over some groups.
 *
 * Errors are of A^-1 (A + (1 + 4 r) D) A^-1, D = sum_i D_i / s_i^2: of S e, and of d (d p), whose variance for Gaussian
 * d of covariance C is C (p^T C p) + C p p^T C, at most 2 C p^T C p; both the noise and what is added again have it,
 * and r is the part p^T D_i p / rows_i of s_i^2, the largest of all joints, at most 1. Where x^T D x > x^T A x in the
 * direction x = A^-1 e_k of a parameter, half of S is noise, and nothing is published. The error of a torque's gain is
 * not in them: `pvid identify --core f32` has it.
 *
 *   static pvid_robot_f32 identifier;
 *   static float memory[ARM_MEMORY];
 *   if (pvid_robot_init_f32(&identifier, &arm_config_f32, memory, ARM_MEMORY) != PVID_OK) ...
 *   each tick:     reason = pvid_robot_step_f32(&identifier, sample);
 *   any context:   if (pvid_robot_read_f32(&identifier, estimate, &number) && (number > 0)) ...
 *
 * After the first estimate a row with |e| > 16 s_i is an outlier: it is not used and the splines restart, so that the
 * sample behind it is in no later row. Four outliers of a joint within 64 of its rows open the gate until as many rows
 * are accepted: a changed plant is followed. Not caught: a bad sample before the first estimate, while a joint has less
 * than 2 p / n + 1 rows or its gate is open, one that moves every row by less than 16 s_i, and the rows of the joints
 * before the one that shows it. What is not caught stays until `memory` rows have passed several times, or init.
 *
 * At rest, friction is any torque up to the dry one. Rows of a joint are not used that contain an interval in which its
 * position stays within 6 standard deviations of its noise: they return PVID_HELD_NOT_EXCITED.
 *
 * Never allocates: all that depends on the model is in `memory`, and no PVID_MAX_ size matters. Every input is allowed.
 * Call all functions from one context, except pvid_robot_read_f32.
 */
#ifndef PVID_ROBOT_H
#define PVID_ROBOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/detail/publication_mark.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PVID_ROBOT_JOINTS 12u /* most joints of a robot */
#define PVID_ROBOT_P 64u      /* most base parameters */
#define PVID_ROBOT_SPLINES 4u /* that overlap */
#define PVID_ROBOT_NOISE 128u /* steps of the period of the added noise */

/* Of a robot: generated. A slot is a column of a joint; the slots of a joint follow each other. */
typedef struct {
    uint8_t joints;        /* n, 1..PVID_ROBOT_JOINTS */
    uint8_t p;             /* base parameters, 1..PVID_ROBOT_P */
    uint16_t forces;       /* results of `values` that are multiplied by B, the first ones */
    uint16_t entries;      /* all results; the others are momenta, multiplied by -B' */
    const uint16_t *end;   /* [n] one past the last slot of each joint */
    const uint8_t *column; /* [slots] the parameter of each, ascending within a joint */
    const uint16_t *slot;  /* [entries] to which each result is added */
    const float *gain;     /* [n] of each recorded torque: 1, or a torque constant; 1e-9..1e9, either sign */
    const float *share;    /* [p] of what added noise changes: 1; of dry friction, whose sign both noises change, 1/2 */
    const bool *held;      /* [n] the torque is held from its sample to the next */
    /* From q [rad, m], v [rad/s, m/s] and the mean of sgn(v) over a step, in[3][n]: out[entries]. */
    void (*values)(const float in[], float out[]);
} pvid_robot_model_f32;

/* Tables for a rig: generated. A step is D ticks, an interval between knots L steps. */
typedef struct {
    uint16_t taps;                   /* of the polynomials that give q and v, odd, 3..1023 */
    uint8_t decimation;              /* D, 1.. */
    uint8_t interval;                /* L, 3.. */
    const float *position;           /* [taps / 2] of q, outwards from the centre, on both sides */
    const float *rate;               /* [taps / 2] of v, outwards, negative on the earlier side [1/s] */
    const float *spline;             /* [4][L] B at the steps, by intervals since its start */
    const float *slope;              /* [4][L] -B' [1/s] */
    const float *torque;             /* [2][4][L D] B / D at the ticks; then half a tick later, of what is held */
    const float *noise;              /* [2][PVID_ROBOT_NOISE] white noise of samples with sd 1, at the steps: as the
                                        polynomials pass it to q and to v [1/s] */
    const float *noise_sd;           /* [n] of each encoder's samples [rad, m]; 0: nothing is corrected */
    float white[PVID_ROBOT_SPLINES]; /* w, w_0 in 1e-9..1e9, of a recursion that is stable */
} pvid_robot_design_f32;

typedef struct {
    const pvid_robot_model_f32 *model;   /* must outlive the identifier, with its tables */
    const pvid_robot_design_f32 *design; /* likewise */
    const float *start;                  /* [p] first estimate, as of the robot's file, within 1e9 */
    const float *start_sd;               /* [p] its standard deviation, 1e-9..1e9 */
    uint16_t group; /* accepted rows of a joint, in the mean of the joints, between two estimates: 1..65535, of which an
                       estimate, 5 n + (2 + p / 10) p + 4 free ticks (p / 10: at most 2), needs some */
    uint32_t memory; /* rows of a joint, 8 p..2^20: as many count in full, older ones half each time */
} pvid_robot_config_f32;

/* Places in `memory`. */
typedef struct {
    uint32_t ring;   /* [2 n][2][taps] samples, each twice */
    uint32_t values; /* [2][entries] of a step, then with added noise */
    uint32_t inputs; /* [2][3][n] likewise */
    uint32_t sums;   /* [2 slots + n][4] columns, torques, then changes by the noise, of each spline */
    uint32_t white;  /* [3][2 slots + n] the last white rows */
    uint32_t s;      /* lower triangle of each joint */
    uint32_t d;      /* likewise */
    uint32_t f;      /* [slots] */
    uint32_t m;      /* lower triangle [p] of A; then its factor L */
    uint32_t noise;  /* lower triangle [p] of D */
    uint32_t z;      /* [p] */
    uint32_t delta;  /* [p] dp */
    uint32_t p;      /* [p] to which F and Q refer */
    uint32_t next;   /* [p] p + dp */
    uint32_t fresh;  /* [2][p] p and its standard errors, and two copies for other contexts */
    uint32_t shared;
    uint32_t copy;
    uint32_t end;
} pvid_robot_places;

/* State; only the functions below write to it. */
typedef struct {
    pvid_robot_config_f32 config;
    float *memory;
    pvid_robot_places at;
    pvid_publication_mark mark;
    float q[PVID_ROBOT_JOINTS];        /* Q_i */
    uint32_t rows[PVID_ROBOT_JOINTS];  /* accepted, in S_i */
    float part;                        /* of s_i^2 that is noise of the encoders, the largest of all joints */
    bool rounded[PVID_ROBOT_JOINTS];   /* Q_i is the rounding of a far larger one: the joint begins again */
    float spread;                      /* of positions of a joint at rest, in noise_sd */
    float from[PVID_ROBOT_JOINTS];     /* position that a joint has been near for .. */
    uint16_t still[PVID_ROBOT_JOINTS]; /* .. so many steps, at most an interval */
    uint8_t rest[PVID_ROBOT_JOINTS];   /* next rows that contain a rest: they are not used */
    uint32_t doubt[PVID_ROBOT_JOINTS]; /* 16 for each outlier, less 1 for each accepted row */
    uint32_t rejected;                 /* samples that were not finite, or beyond their range */
    uint32_t saturated;                /* rows beyond 1e9 */
    uint32_t outliers;                 /* rows of a joint */
    uint32_t held;                     /* groups without an estimate */
    uint32_t number;                   /* of estimates */
    uint32_t since;                    /* accepted rows of all joints since the last group */
    uint16_t slots;
    uint16_t filled; /* samples in the ring, at most `taps` */
    uint16_t place;  /* of the next one */
    uint16_t tick;   /* in the interval */
    uint8_t spline;  /* the youngest one, of 4 */
    uint8_t young;   /* intervals until a spline has been added from its start on */
    uint8_t latest;  /* place of the latest white rows, of 3 */
    uint8_t row;     /* twice the joint whose row is next, and 1: what noise changes in it; all: none */
    uint8_t noise;   /* place of the step in the added noise */
    uint8_t stage;
    uint8_t index;     /* within the stage */
    uint8_t corrected; /* joints whose F and Q are of `next` already */
    bool begun;        /* there are rates of a step before */
    bool factor;       /* m contains the factor of the latest estimate */
} pvid_robot_f32;

/* Floats of `memory` that a robot and a design need; 0 where init refuses one of the two. */
uint32_t pvid_robot_memory_f32(const pvid_robot_model_f32 *model, const pvid_robot_design_f32 *design);

/* Initialises `self`. *config is copied; what it points to, and memory[room], must outlive the identifier. Fails iff
 *   - self, config, its model or design, or memory is NULL (PVID_BAD_POINTER); a NULL inside has the status of what it
 *     belongs to; room is below pvid_robot_memory_f32 (PVID_BAD_LAYOUT),
 *   - a count of the model is out of its range, or a slot, a column or a gain is (PVID_BAD_MODEL),
 *   - a count of the design is out of its range, a table beyond 1e9 or not finite, or `white` as it says
 *     (PVID_BAD_DESIGN),
 *   - an interval has too few ticks for the rows of all joints, or a group too few for an estimate (PVID_BAD_WINDOW),
 * or
 *   - start is out of its range (PVID_BAD_START), start_sd (PVID_BAD_START_SD) or memory (PVID_BAD_FORGETTING). */
pvid_status pvid_robot_init_f32(pvid_robot_f32 *self, const pvid_robot_config_f32 *config, float memory[],
                                uint32_t room);

/* One tick: sample[2 n] = q_1 .. q_n [rad, m], then torques (or currents) of the same instant. Returns
 *   - PVID_WARMING_UP until the first row, and while the polynomials fill after a restart,
 *   - PVID_REJECTED_NOT_FINITE for a sample that is not, PVID_REJECTED_SATURATED for |q| > 16384 or a torque beyond
 * 1e9, or a row beyond 1e9, PVID_REJECTED_OUTLIER for a row: each restarts the splines,
 *   - PVID_HELD_NOT_EXCITED where the row of a joint contains a rest of it and is not used,
 *   - PVID_UPDATED at the tick of a new estimate,
 *   - PVID_HELD_UNCERTAIN in its place while a standard error is not below half its start_sd, or the noise of the
 * encoders is more than half of S in the direction of a parameter: motion or time is missing,
 *   - PVID_HELD_SINGULAR where A is not positive definite, or its solution is beyond 1e9,
 *   - PVID_NOT_READY before init, else PVID_ACCUMULATED. */
pvid_reason pvid_robot_step_f32(pvid_robot_f32 *self, const float sample[]);

/* Samples are missing: the splines restart, the sums are kept. */
void pvid_robot_gap_f32(pvid_robot_f32 *self);

/* Copies p and then its standard errors, estimate[2 p], from any context. *number: estimates so far; 0: the start.
 * Fails iff an estimate was published during each of PVID_READ_ATTEMPTS attempts, or `self` is not initialised. */
bool pvid_robot_read_f32(const pvid_robot_f32 *self, float estimate[], uint32_t *number);

/* Column k of the covariance of the latest estimate, out[p]. Fails iff `self` is not initialised, there is no k, or a
 * group has begun since, until the next PVID_UPDATED: call it at that tick, or soon after. Cost: 3 p^2 multiplications.
 */
bool pvid_robot_covariance_f32(const pvid_robot_f32 *self, uint8_t k, float out[]);

/* FNV-1a, continued from `hash`, of p, its standard errors, F, Q and a reason: equal on every computer. */
uint32_t pvid_robot_hash_f32(uint32_t hash, const pvid_robot_f32 *self, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
