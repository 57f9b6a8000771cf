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
 * of rows ends with (sum_i S_i / s_i^2 + prior) dp = sum_i F_i / s_i^2 + prior, s_i^2 = Q_i / rows, by Cholesky, a row
 * of the factor each tick. Then F_i -= S_i dp and Q_i follow p: rounding of S_i acts on dp alone. No window of samples
 * is kept.
 *
 *   static pvid_robot_f32 identifier;
 *   static float memory[ARM_MEMORY];
 *   if (pvid_robot_init_f32(&identifier, &arm_config_f32, memory, ARM_MEMORY) != PVID_OK) ...
 *   each tick:     reason = pvid_robot_step_f32(&identifier, sample);
 *   any context:   if (pvid_robot_read_f32(&identifier, estimate, &number) && (number > 0)) ...
 *
 * Never allocates: all that depends on the model is in `memory`, and no PVID_MAX_ size matters. Every input is allowed.
 * Call all functions from one context, except pvid_robot_read_f32. Noise of the encoders in the columns is not
 * corrected: it biases by less than a standard error where the encoders have 16 bits and more.
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

/* Of a robot: generated. A slot is a column of a joint; the slots of a joint follow each other. */
typedef struct {
    uint8_t joints;        /* n, 1..PVID_ROBOT_JOINTS */
    uint8_t p;             /* base parameters, 1..PVID_ROBOT_P */
    uint16_t forces;       /* results of `values` that are multiplied by B, the first ones */
    uint16_t entries;      /* all results; the others are momenta, multiplied by -B' */
    const uint16_t *end;   /* [n] one past the last slot of each joint */
    const uint8_t *column; /* [slots] the parameter of each, ascending within a joint */
    const uint16_t *slot;  /* [entries] to which each result is added */
    const float *gain;     /* [n] of each recorded torque: 1, or a torque constant */
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
    float white[PVID_ROBOT_SPLINES]; /* w */
} pvid_robot_design_f32;

typedef struct {
    const pvid_robot_model_f32 *model;   /* must outlive the identifier, with its tables */
    const pvid_robot_design_f32 *design; /* likewise */
    const float *start;                  /* [p] first estimate, as of the robot's file */
    const float *start_sd;               /* [p] its standard deviation, > 0 */
    uint16_t group;                      /* rows of a joint between two estimates */
    uint32_t memory; /* rows of a joint, at least 2 p: as many count in full, older ones half each time */
} pvid_robot_config_f32;

/* Places in `memory`. */
typedef struct {
    uint32_t ring;   /* [2 n][2][taps] samples, each twice */
    uint32_t values; /* [entries] of a step */
    uint32_t inputs; /* [3][n] likewise */
    uint32_t sums;   /* [slots + n][4] columns, then torques, of each spline */
    uint32_t white;  /* [3][slots + n] the last white rows */
    uint32_t s;      /* lower triangle of each joint */
    uint32_t f;      /* [slots] */
    uint32_t m;      /* lower triangle [p]; then its factor L */
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
    float q[PVID_ROBOT_JOINTS]; /* Q_i */
    uint32_t rows;              /* of each joint, in S_i */
    uint32_t rejected;          /* samples that were not finite */
    uint32_t saturated;         /* rows of a joint beyond 1e9 */
    uint32_t singular;          /* groups whose system could not be solved */
    uint32_t number;            /* of estimates */
    uint16_t slots;
    uint16_t filled; /* samples in the ring, at most `taps` */
    uint16_t place;  /* of the next one */
    uint16_t tick;   /* in the interval */
    uint16_t since;  /* rows since the last group */
    uint8_t spline;  /* the youngest one, of 4 */
    uint8_t young;   /* intervals until a spline has been added from its start on */
    uint8_t latest;  /* place of the latest white rows, of 3 */
    uint8_t row;     /* joint whose row is next; all: none */
    uint8_t stage;
    uint8_t index;     /* within the stage */
    uint8_t corrected; /* joints whose F and Q are of `next` already */
    bool begun;        /* there are rates of a step before */
    bool factor;       /* m contains the factor of the latest estimate */
} pvid_robot_f32;

/* Floats of `memory` that a robot and a design need. */
uint32_t pvid_robot_memory_f32(const pvid_robot_model_f32 *model, const pvid_robot_design_f32 *design);

/* Initialises `self`. *config is copied; what it points to, and memory[room], must outlive the identifier. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or room is below pvid_robot_memory_f32 (PVID_BAD_LAYOUT),
 *   - a count of the model is out of its range, or a slot or column is (PVID_BAD_MODEL),
 *   - a count of the design is out of its range, or a table is not finite (PVID_BAD_DESIGN),
 *   - an interval has too few ticks for the rows of all joints, or a group too few for an estimate (PVID_BAD_WINDOW),
 * or
 *   - start is not finite (PVID_BAD_START), start_sd not in 1e-9..1e9 (PVID_BAD_START_SD), memory is below 2 p or above
 *     2^20 (PVID_BAD_FORGETTING). */
pvid_status pvid_robot_init_f32(pvid_robot_f32 *self, const pvid_robot_config_f32 *config, float memory[],
                                uint32_t room);

/* One tick: sample[2 n] = q_1 .. q_n [rad, m], then torques (or currents) of the same instant. Returns
 *   - PVID_WARMING_UP until the first row, PVID_REJECTED_NOT_FINITE for a sample that is not, which restarts the
 * splines,
 *   - PVID_UPDATED at the tick of a new estimate, PVID_HELD_SINGULAR where a direction has no information,
 *   - PVID_REJECTED_SATURATED for a row beyond 1e9, PVID_NOT_READY before init, else PVID_ACCUMULATED. */
pvid_reason pvid_robot_step_f32(pvid_robot_f32 *self, const float sample[]);

/* Samples are missing: the splines restart, the sums are kept. */
void pvid_robot_gap_f32(pvid_robot_f32 *self);

/* Copies p and then its standard errors, estimate[2 p], from any context. *number: estimates so far; 0: the start.
 * Fails iff an estimate was published during each of PVID_READ_ATTEMPTS attempts, or `self` is not initialised. */
bool pvid_robot_read_f32(const pvid_robot_f32 *self, float estimate[], uint32_t *number);

/* Column k of the covariance of the latest estimate, out[p]. Fails iff `self` is not initialised, there is no k, or an
 * estimate is being computed: call it at the tick of PVID_UPDATED, or soon after. Cost: p^2 multiplications. */
bool pvid_robot_covariance_f32(const pvid_robot_f32 *self, uint8_t k, float out[]);

/* FNV-1a, continued from `hash`, of p, its standard errors, F, Q and a reason: equal on every computer. */
uint32_t pvid_robot_hash_f32(uint32_t hash, const pvid_robot_f32 *self, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
