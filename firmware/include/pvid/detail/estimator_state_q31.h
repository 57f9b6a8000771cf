/* pvid/detail/estimator_state_q31.h - the state behind estimator_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_ESTIMATOR_STATE_Q31_H
#define PVID_DETAIL_ESTIMATOR_STATE_Q31_H

#include "pvid/detail/p_bits.h"
#include "pvid/estimator_q31.h"

/* Layout of the sums: M (the upper triangle of the block of each kind by rows), n_theta of b, rr, weight (Q16). */
#define PVID_MAX_SUMS_Q31 (PVID_MAX_MOMENTS_Q31 + PVID_MAX_THETA_Q31 + 2)

/* r 2^e, a square root: r of 30 or 31 bits, or 0. */
typedef struct {
    int32_t r;
    int32_t e;
} pvid_root_q31;

/* The sums M, b, rr and weight. */
typedef struct {
    uint8_t n_theta;
    uint8_t exponent; /* M, b and rr are divided by 4^exponent */
    uint16_t n_sums;
    uint16_t block;    /* groups of rows between two forgettings */
    uint16_t age;      /* groups since the last one */
    int32_t retention; /* factor on the past, Q31; 2^31 - 1: everything is kept */
    uint32_t row_weight;
    int64_t sums[PVID_MAX_SUMS_Q31];
} pvid_information_q31;

/* What the step and the assessment need beside the normal equations, in the formats of the configuration; written by
 * init alone. */
typedef struct {
    int32_t prior[PVID_MAX_P]; /* H0 = prior 2^-prior_exponent */
    int16_t prior_exponent[PVID_MAX_P];
    int32_t start_sd[PVID_MAX_P];
    int32_t lower[PVID_MAX_P];
    int32_t upper[PVID_MAX_P];
    int32_t row_sd;
    int32_t gain; /* g */
    uint32_t correlation;
    uint32_t step_limit;
    int32_t kappa_min;
    uint32_t noise_margin;
    uint32_t dead_zone;
    int8_t p_bits[PVID_MAX_P];
    uint8_t n_p;          /* parameters */
    pvid_p_bits positive; /* bit a set: p[a] > 0, steps are relative to p[a], else to start_sd[a] */
    pvid_p_bits blocked;  /* bit a set: p[a] was at its bound, and the last solve would have moved it outwards */
} pvid_solve_settings_q31;

/* Only the functions of estimator_q31.h write to it. */
struct pvid_estimator_q31 {
    const pvid_model_q31 *model;
    pvid_information_q31 information;
    int32_t p[PVID_MAX_P];
    int64_t theta[PVID_MAX_THETA_Q31];    /* f(p) */
    int32_t mantissa[PVID_MAX_THETA_Q31]; /* of theta, 30 bits, */
    int16_t shift[PVID_MAX_THETA_Q31];    /* right shift of N_i mantissa_i to units of Y */
    int64_t fresh[PVID_MAX_THETA_Q31];    /* sum N e since the last solve */
    int16_t align[PVID_MAX_THETA_Q31];    /* N_i theta_i 2^-align is in units of Y */
    int16_t theta_bits[PVID_MAX_THETA_Q31];
    int16_t c_exponent[PVID_MAX_C_Q31]; /* C_k 2^c_exponent: units of Y per N and p */
    pvid_solve_settings_q31 settings;
    int32_t
        noise_table[(PVID_MAX_P * (PVID_MAX_P + 1)) / 2]; /* information of noise of variance 1 in noise_rows rows, */
    uint16_t noise_rows; /* upper triangle by rows, packed (scaled_q31.h); 0: unknown; the weak form writes it */
    int64_t group_rss;   /* sum of e^2 of the rows of the current group, each at the p of its tick, at most PVID_WIDE */
    int64_t group_weight;     /* their weight, Q16 */
    pvid_scaled_q31 expected; /* mean over the rows in the sums of the variance that the sensors' noise gives them
                                 [units of Y's integer squared]: residual variances are at least this. 0: not set */
    uint16_t divider;
    uint16_t phase; /* groups since the last solve */
    pvid_counters counters;
};

/* 1/x = m 2^(k - 61), 2^30 <= m < 2^31, of an integer x. */
typedef struct {
    int32_t m;
    uint8_t k;
} pvid_reciprocal_q31;

/* S = U U^T, both in Q30; elimination runs from the last index to the first, so that the last pivot is that of
 * index 0. */
typedef struct {
    uint8_t n;
    bool positive;                           /* no pivot so far was rounding */
    int32_t u[PVID_MAX_P][PVID_MAX_P];       /* above the diagonal */
    pvid_reciprocal_q31 inverse[PVID_MAX_P]; /* 1 / U_jj in Q30 is m 2^(k - 31) */
    int32_t first_pivot;                     /* pivot of index 0 over its diagonal entry, Q30 */
    int64_t pivot[PVID_MAX_P];               /* Q60 */
} pvid_cholesky_q31;

/* The normal equations of a solve (estimator.h), their scaling and factor. The residuals at p are in the sums. */
typedef struct {
    int64_t s[PVID_MAX_P][PVID_MAX_P]; /* S, for a step S + H0, in units of 2^(f_a + f_b + 32); upper triangle */
    int64_t first_prior;               /* H0 of p[0], in the units of s; only for a step */
    int16_t f[PVID_MAX_P];
    int16_t g[PVID_MAX_P];
    int32_t q[PVID_MAX_P][PVID_MAX_P]; /* s_ab 2^-(g_a + g_b), which is factored */
    pvid_cholesky_q31 factor;
} pvid_system_q31;

/* Of an assessment: the inverse of a factor, and the variance that standard errors are made of. */
typedef struct {
    pvid_root_q31 wide;                     /* root of correlation s^2 */
    int32_t column[PVID_MAX_P][PVID_MAX_P]; /* columns of U^-1 */
    pvid_root_q31 root[PVID_MAX_P];         /* their lengths */
} pvid_inverse_q31;

/* Of a solve or an assessment up to S, and the right-hand side of a solve. */
typedef struct {
    int32_t c[PVID_MAX_C_Q31];         /* C_k = c_k 2^(f_column - h_row), f of the system */
    int32_t force[PVID_MAX_THETA_Q31]; /* by rows: 2^(force_exponent + h_row) */
    int32_t force_exponent;
} pvid_solve_force_q31;

/* Of a solve from its step on. */
typedef struct {
    int64_t theta[PVID_MAX_THETA_Q31]; /* after the step, likewise p and b: b -= moved */
    int32_t p[PVID_MAX_P];
    int32_t theta_step[PVID_MAX_THETA_Q31]; /* theta_step_j 2^(step_exponent - h_j) in units of Y per N */
    int32_t step_exponent;
    int64_t moved[PVID_MAX_THETA_Q31];
} pvid_solve_step_q31;

/* What a solve or an assessment needs early, a solve and an assessment later.
 * MISRA deviation: 19.2; what a stage reads, a stage of the same part has written. Likewise the next one. */
typedef union {
    pvid_solve_force_q31 early;
    int64_t dp[PVID_MAX_P];
    pvid_inverse_q31 inverse;
} pvid_solve_parts_q31;

/* M, until S is made of it in an assessment, whose result then may have its place. */
typedef union {
    int32_t m[PVID_MAX_MOMENTS_Q31]; /* M_ij = m_ij 2^(h_i + h_j) */
    pvid_estimate_q31 estimate;
} pvid_solve_matrix_q31;

/* What they need of the system, and a solve behind it. */
typedef union {
    pvid_system_q31 system;
    pvid_solve_step_q31 step;
} pvid_solve_equations_q31;

/* A solve or an assessment in progress; the caller owns it. Read reason, size, group_rss and above_noise when it is
 * complete. The caller may set fallback and keeps_matrix after begin. */
struct pvid_estimator_solve_q31 {
    pvid_reason reason;
    uint8_t stage;
    uint8_t index; /* of the row within the stage */
    uint8_t start; /* first non-zero of the present column of C */
    bool ends_group;
    bool judging;     /* an assessment */
    bool above_noise; /* S contains more information than noise alone */
    bool has_fallback;
    bool in_dead_zone;            /* within the dead zone: no step is taken */
    bool keeps_matrix;            /* M is that of the last solve: m and h stay */
    pvid_p_bits pinned;           /* bit a: p[a] stays at its bound */
    int32_t fallback[PVID_MAX_P]; /* value of p if no step is allowed */
    int64_t size;                 /* largest |dp/p| of the step before step_limit, Q22; 0 if p is held */
    int64_t group_rss;            /* sum of e^2 of the group's rows, each at the p of its tick */
    pvid_scaled_q31 variance;     /* of a row, divided by 4^exponent as the sums are */
    int32_t gain;
    pvid_solve_matrix_q31 matrix;
    int16_t h[PVID_MAX_THETA_Q31];
    pvid_solve_parts_q31 part;
    pvid_solve_equations_q31 now;
    int32_t score[PVID_MAX_P]; /* of a solve that ends a group: C^T sum N e since the last such, times 2^-exponent */
    int32_t score_exponent[PVID_MAX_P];
};

#endif
