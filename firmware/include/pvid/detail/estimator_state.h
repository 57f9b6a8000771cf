/* pvid/detail/estimator_state.h - the state behind estimator.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_ESTIMATOR_STATE_H
#define PVID_DETAIL_ESTIMATOR_STATE_H

#include "pvid/detail/p_bits.h"
#include "pvid/estimator.h"

/* What the step and the assessment need beside the normal equations; written by init alone, but for `blocked`. */
typedef struct {
    float prior[PVID_MAX_P];    /* diagonal of H0 [units of S] */
    float start_sd[PVID_MAX_P]; /* as in the configuration, with the fields below */
    float lower[PVID_MAX_P];
    float upper[PVID_MAX_P];
    float row_variance; /* row_sd^2 [units of Y^2] */
    float gain;         /* g */
    float correlation;
    float step_limit;
    float kappa_min;
    float noise_margin;
    float dead_zone; /* square of the configured one */
#if PVID_MAX_DRIFTS > 0
    float drift_keep; /* share of the information along a drift that a group leaves */
#endif
    uint8_t n_p;          /* parameters */
    pvid_p_bits positive; /* bit a set: p[a] > 0, steps are relative to p[a], else to start_sd[a] */
    pvid_p_bits blocked;  /* bit a set: p[a] was at its bound, and the last solve would have moved it outwards */
} pvid_solve_settings_f32;

#if PVID_MAX_CONSTRAINTS > 0
/* Constraints at a p, each solved for a parameter: dp[place] = rest - slope dp. */
typedef struct {
    uint8_t count;                       /* of those that are independent of each other */
    pvid_p_bits dependent;               /* bit a: p[a] is the place of one */
    uint8_t place[PVID_MAX_CONSTRAINTS]; /* that parameter */
    float rest[PVID_MAX_CONSTRAINTS];
    float slope[PVID_MAX_CONSTRAINTS][PVID_MAX_P]; /* 0 of dependent parameters */
    float off;                                     /* sum of |g|, in large steps */
} pvid_constraints_f32;
#endif

/* The normal equations of a solve and the residuals at p, gathered from the sums (estimator.h):
 *
 *   (S + H0) dp = gamma F + (1 - gamma) sum C^T N e,   S = C^T M C,   F = C^T (B - M theta) */
typedef struct {
    float s[PVID_MAX_P][PVID_MAX_P]; /* S [n_p][n_p], for a step S + H0; upper triangle */
    float force[PVID_MAX_P];         /* F [n_p] */
    float rss;                       /* residual sum of squares of the rows in the sums [units of Y^2] */
    float rounding;                  /* bound of its rounding error [units of Y^2] */
    float floor;                     /* lower limit of rss + rounding [units of Y^2] */
    float weight;                    /* rows in the sums */
#if PVID_MAX_CONSTRAINTS > 0
    pvid_constraints_f32 ties; /* S and F are those of the independent parameters */
#endif
} pvid_system_f32;

/* Only the functions of estimator.h write to it. */
struct pvid_estimator_f32 {
    const pvid_model_f32 *model;
    pvid_information_f32 information;
    float p[PVID_MAX_P];
    float theta[PVID_MAX_THETA]; /* f(p) */
#if PVID_FEEDBACK
    float innovation[PVID_MAX_P]; /* sum C^T N e since the last solve; only while gamma < 1 */
#endif
    pvid_solve_settings_f32 settings;
    float group_rss;    /* sum of e^2 of the rows of the current group, each at the p of its tick */
    float group_weight; /* their weight */
    float expected;     /* mean over the rows in the sums of their variance by the sensors' noise [units of Y^2]: lower
                           limit of the residual variance. 0: unknown */
    uint16_t divider;
    uint16_t phase; /* groups since the last solve */
    pvid_counters counters;
};

/* D S D = U U^T with D a diagonal of powers of two and U upper triangular. Elimination runs from the last index to the
 * first: the last pivot is that of p[0]. */
typedef struct {
    uint8_t n;
    float scale[PVID_MAX_P];         /* D: diagonal entries of D S D lie in [1, 4) */
    float u[PVID_MAX_P][PVID_MAX_P]; /* upper triangle; the diagonal holds 1 / U_ii */
    float first_pivot;               /* pivot of index 0 over its diagonal entry: 1 - R^2 */
} pvid_cholesky_f32;

/* What one part of a solve needs after the other; an assessment needs C and the factor. */
typedef union {
    float c[PVID_MAX_C];      /* until S and F are formed */
    pvid_cholesky_f32 factor; /* until dp is known */
    struct {
        float after[PVID_MAX_THETA]; /* the step */
        float step[PVID_MAX_THETA];  /* dtheta */
    } theta;
} pvid_solve_work_f32;

/* A solve or an assessment in progress; the caller owns it. Read reason, size, group_rss and above_noise when it is
 * complete. The caller may set fallback and noise after begin. */
struct pvid_estimator_solve_f32 {
    pvid_reason reason;
    const float *fallback;            /* [n_p] value of p if no step is allowed; NULL: p is unchanged */
    const float (*noise)[PVID_MAX_P]; /* information of noise alone that a solve's S must exceed noise_margin times: of
                                         unit variance, per unit of weight, upper triangle; NULL: unknown, no check */
    pvid_estimate_f32 *estimate;      /* of an assessment; NULL for a solve */
    float size;                       /* largest |dp/p| of the step before step_limit; 0 if p is held */
    float group_rss;                  /* sum of e^2 of the group's rows, each at the p of its tick */
    float variance;                   /* of a row: row_sd^2 in a solve, s^2 of the residuals in an assessment */
    bool above_noise;                 /* S contains more information than noise alone */
    bool solvable;                    /* of an assessment: S could be factored */
    uint8_t stage;
    uint8_t index; /* of the row or column within the stage */
    uint8_t start; /* first non-zero of the present column of C */
    uint8_t next;  /* next non-zero of this column */
    uint8_t end;   /* behind its last one */
    bool ends_group;
    bool in_dead_zone;  /* within the dead zone: no step is taken */
    pvid_p_bits pinned; /* bit a: p[a] stays at its bound */
    float gain;         /* gamma of this solve */
    float fall;         /* decrease of rr by the step */
    float scale;        /* sum of M_ii dtheta_i^2: size of the terms that cancel in `fall` */
    float sums[PVID_MAX_SUMS];
    pvid_solve_work_f32 work;
    pvid_system_f32 system;
    float p[PVID_MAX_P];           /* after the step */
    float product[PVID_MAX_THETA]; /* M times a column of C, then M dtheta: b -= product */
    float diagonal[PVID_MAX_P];    /* of S without H0 */
};

#endif
