/* A solve of the strong form in integers: factor, step, limits. */
#include <string.h>

#include "kapitza_integer_q31.h"
#include "kapitza_sums_q31.h"
#include "number/count.h"
#include "number/init.h"
#include "number/unroll.h"
#include "solve/commit.h"
#include "solve/information_q31.h"
#include "solve/settings_q31.h"
#include "solve/step_q31.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

#define L_BITS 29u       /* of L, |.| < 2 */
#define PIVOT_SHIFT 20u  /* a pivot not above this part of its diagonal entry is rounding, not data */
#define RHS_BITS 27      /* of a right-hand side */
#define SOLUTION_BITS 27 /* of a solution without the terms beside the diagonal: with them it fits 32 bits */
#define FORCE_MAX ((int64_t)1 << 61)
#define STEP_MAX ((int64_t)1 << 40) /* of |dp|, far beyond the bounds of p */
#define SHIFT_MAX 31
#define BITS_MAX 60

/* ---- configuration ---- */

static bool is_shift(int32_t shift)
{
    return (shift >= -SHIFT_MAX) && (shift <= SHIFT_MAX);
}

static bool rows_are_valid(const pvid_strong_row_q31 *rows)
{
    bool valid = (rows->phi3 > 0) && (rows->reference >= 0) && (rows->reference <= PVID_KAPITZA_RATE_LIMIT_Q31) &&
                 is_shift(rows->finer[0]) && is_shift(rows->finer[1]) &&
                 is_shift((int32_t)rows->phi_shift[2] + rows->finer[0]);
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        valid = valid && is_shift(rows->phi_shift[k]);
    }
    return valid;
}

/* The format of a product of d1 with -G^k phi'', of d2 with -G^k phi. */
static bool is_format(int32_t bits)
{
    return (bits >= 0) && (bits <= BITS_MAX);
}

static pvid_status prepare(pvid_kapitza_estimator_q31 *self, const pvid_estimator_config_q31 *config,
                           const pvid_strong_row_q31 *rows)
{
    if (!rows_are_valid(rows)) {
        return PVID_BAD_SHIFT;
    }
    const int32_t bits_1 = (int32_t)config->p_bits[D1] + rows->finer[0];
    const int32_t bits_2 = (int32_t)config->p_bits[D2] + rows->finer[1];
    if ((config->p_bits[W] != PVID_KAPITZA_W_BITS) || !is_format(bits_1) || !is_format(bits_2)) {
        return PVID_BAD_FORMAT;
    }
    const pvid_status status = pvid_settings_are_valid_q31(config, PVID_KAPITZA_P, 7u);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    pvid_settings_init_q31(&self->settings, config, PVID_KAPITZA_P, 7u);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        self->p[a] = config->start[a];
    }
    self->reference = 2 * rows->reference;
    self->bits[0] = (int8_t)bits_1;
    self->bits[1] = (int8_t)bits_2;
    self->retention = pvid_information_retention_q31(config->forgetting_groups, &self->block);
    self->divider = config->divider;
    self->ready = true;
    return PVID_OK;
}

PVID_COLD pvid_status pvid_kapitza_estimator_init_q31(pvid_kapitza_estimator_q31 *self,
                                                      const pvid_estimator_config_q31 *config,
                                                      const pvid_strong_row_q31 *rows)
{
    const bool given = pvid_init_is_given(self, config) && (rows != NULL);
    const pvid_status status = given ? prepare(self, config, rows) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

/* ---- factor ---- */

/* S + H0 = L D L^T, equilibrated by powers of two: S_ab = s_ab 2^(g_a + g_b), s_aa in [2^28, 2^30); the elimination
 * runs from the last parameter to the first. */
typedef struct {
    int32_t g[PVID_KAPITZA_P];
    int32_t s00;
    int32_t prior; /* H0 of w likewise */
    int32_t l01;   /* Q29 */
    int32_t l02;
    int32_t l12;
    int32_t p0;                      /* pivot of w */
    int32_t inverse[PVID_KAPITZA_P]; /* 2^(58 - up) / pivot */
    uint32_t up[PVID_KAPITZA_P];
} factors;

/* x 2^exponent = (S + H0)^-1 F: w', d1', d2' of the system; b: F equilibrated, times 2^of_b. */
typedef struct {
    int32_t x[PVID_KAPITZA_P];
    int32_t b[PVID_KAPITZA_P];
    int32_t of_b;
    int32_t exponent; /* of x[a], less g[a] */
} solutions;

/* 2^58 / d for d in [2^29, 2^30): a division of 32 bits and a Newton step. */
static int32_t inverse_of(int32_t d)
{
    PVID_ASSERT(d >= ((int32_t)1 << 29));
    const int32_t r = (int32_t)(((uint32_t)1 << 31) / ((uint32_t)d >> 14)); /* 2^45 / d, 15 bits of it */
    const int64_t rest = ((int64_t)1 << 45) - pvid_product_q31(d, r);
    const int32_t more = (int32_t)pvid_nearest_q31(pvid_product_q31((int32_t)pvid_nearest_q31(rest, 15), r), 17);
    return (r * 8192) + more;
}

/* x 2^up in [2^29, 2^30), 1 <= x < 2^30. */
static int32_t raised(int32_t x, uint32_t *up)
{
    *up = 30u - pvid_bit_length_q31((uint64_t)x);
    return x * (int32_t)((uint32_t)1 << *up);
}

static void invert(factors *factor, size_t a, int64_t pivot)
{
    const int32_t below = (int32_t)((pivot < PVID_ONE_Q30) ? pivot : (PVID_ONE_Q30 - 1));
    factor->inverse[a] = inverse_of(raised(below, &factor->up[a]));
}

/* a b with b in the format of L. */
static inline int32_t by_l(int32_t a, int32_t b)
{
    return (int32_t)pvid_nearest_q31(pvid_short_product_q31(a, b), L_BITS);
}

/* x / pivot a in Q29, to be shifted up by up[a]. */
static inline int32_t over_pivot(const factors *factor, size_t a, int32_t x)
{
    return by_l(x, factor->inverse[a]);
}

/* The same as an entry of L, |.| < 2: a product with an entry of S fits 32 bits. */
static inline int32_t entry_of_l(const factors *factor, size_t a, int32_t x)
{
    const uint32_t up = factor->up[a];
    const int32_t l = over_pivot(factor, a, x);
    const int32_t most = pvid_floor_shift_32_q31(PVID_ONE_Q30 - 1, up);
    const int32_t above = (l < -most) ? -most : l;
    return pvid_moved_q31((above > most) ? most : above, (int32_t)up);
}

/* s 2^-g, 0 <= s, of 32 bits as a rule; 2^30 at most by the choice of g. */
static inline int32_t equilibrated(int64_t s, int32_t g)
{
    return (s <= INT32_MAX) ? pvid_moved_q31((int32_t)s, -g)
                            : (int32_t)pvid_clamp_q31(pvid_scale_q31(s, g), PVID_ONE_Q30);
}

/* The same on the diagonal, 1 <= s: in [2^28, 2^30] by the choice of g. */
static inline int32_t on_diagonal(int64_t s, int32_t g)
{
    return equilibrated(s, 2 * g);
}

/* x 2^-shift rounded half up, saturated at +-PVID_WIDE; to the right as a rule. */
static inline int64_t scaled_down(int32_t x, int32_t shift)
{
    return (shift >= 0) ? pvid_moved_q31(x, -shift) : pvid_scale_q31(x, shift);
}

/* An entry beside the diagonal, |.| <= 2^30. */
static inline int32_t beside(int64_t s, int32_t g)
{
    const int32_t q = (g >= -31) ? pvid_moved_q31((int32_t)s, -g) : 0;
    const int32_t above = (q < -PVID_ONE_Q30) ? -PVID_ONE_Q30 : q;
    return (above > PVID_ONE_Q30) ? PVID_ONE_Q30 : above;
}

/* S_aa + H0_aa, and H0_aa. */
static int64_t with_prior(const pvid_kapitza_estimator_q31 *self, size_t a, int64_t s, int32_t of, int64_t *prior)
{
    const int32_t shift = (int32_t)self->settings.prior_exponent[a] + (2 * (of + (int32_t)self->exponent));
    *prior = 0;
    if (shift < 32) {
        *prior = pvid_clamp_q31(scaled_down(self->settings.prior[a], shift), PVID_WIDE / 4);
    }
    return s + *prior;
}

/* Factors S + H0, H0 the prior of the settings. Returns whether every pivot is data, not rounding. */
PVID_NOINLINE static bool factorise(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                                    factors *factor)
{
    int32_t of[PVID_KAPITZA_P];
    int64_t prior;
    int64_t prior_w;
    pvid_kapitza_exponents_q31(self, system, of);
    const int64_t s22 = with_prior(self, D2, system->s[5], of[D2], &prior);
    const int64_t s11 = with_prior(self, D1, system->s[3], of[D1], &prior);
    const int64_t s00 = with_prior(self, W, system->s[0], of[W], &prior_w);
    if ((s00 <= 0) || (s11 <= 0) || (s22 <= 0)) {
        return false;
    }
    int32_t *g = factor->g;
    g[W] = pvid_half_exponent_q31(s00);
    g[D1] = pvid_half_exponent_q31(s11);
    g[D2] = pvid_half_exponent_q31(s22);
    const int32_t q01 = beside(system->s[1], g[W] + g[D1]);
    const int32_t q02 = beside(system->s[2], g[W] + g[D2]);
    const int32_t q12 = beside(system->s[4], g[D1] + g[D2]);
    const int32_t q11 = on_diagonal(s11, g[D1]);
    factor->s00 = on_diagonal(s00, g[W]);
    factor->prior = equilibrated(prior_w, 2 * g[W]);
    invert(factor, D2, on_diagonal(s22, g[D2]));
    factor->l02 = entry_of_l(factor, D2, q02);
    factor->l12 = entry_of_l(factor, D2, q12);
    const int64_t p1 = (int64_t)q11 - by_l(factor->l12, q12);
    if (p1 <= pvid_floor_shift_32_q31(q11, PIVOT_SHIFT)) {
        return false;
    }
    invert(factor, D1, p1);
    const int32_t c01 = (int32_t)pvid_clamp_q31((int64_t)q01 - by_l(factor->l02, q12), PVID_ONE_Q30);
    factor->l01 = entry_of_l(factor, D1, c01);
    const int64_t p0 = ((int64_t)factor->s00 - by_l(factor->l02, q02)) - by_l(factor->l01, c01);
    if (p0 <= pvid_floor_shift_32_q31(factor->s00, PIVOT_SHIFT)) {
        return false;
    }
    factor->p0 = (int32_t)((p0 < PVID_ONE_Q30) ? p0 : PVID_ONE_Q30);
    invert(factor, W, factor->p0);
    return true;
}

/* ---- solution ---- */

/* Bits of x 2^up beyond those of a solution, if any. */
static inline int32_t bits_beyond(int32_t x, uint32_t up)
{
    const int32_t beyond = ((int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x)) + (int32_t)up) - SOLUTION_BITS;
    return (beyond > 0) ? beyond : 0;
}

/* f 2^-shift rounded half up, of 27 bits by the choice of the shift. */
static inline int32_t right_hand_side(int64_t f, int32_t shift)
{
    return pvid_narrowed_q31(f, shift);
}

/* y 2^(up - down), of 27 bits by the choice of down. */
static inline int32_t lifted(int32_t y, uint32_t up, int32_t down)
{
    return pvid_moved_q31(y, (int32_t)up - down);
}

/* The solution for f, |f| < 2^62. */
PVID_NOINLINE static void solve_for(const factors *factor, const int64_t f[PVID_KAPITZA_P], solutions *solution)
{
    int32_t h = INT32_MIN;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const int32_t length = pvid_length_q31(f[a]) - factor->g[a];
        h = (length > h) ? length : h;
    }
    h -= RHS_BITS;
    int32_t *b = solution->b;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        b[a] = right_hand_side(f[a], factor->g[a] + h);
    }
    solution->of_b = h - 30;
    const int32_t z1 = b[D1] - by_l(factor->l12, b[D2]);
    const int32_t z0 = (b[W] - by_l(factor->l02, b[D2])) - by_l(factor->l01, z1);
    const int32_t y0 = over_pivot(factor, W, z0);
    const int32_t y1 = over_pivot(factor, D1, z1);
    const int32_t y2 = over_pivot(factor, D2, b[D2]);
    const int32_t down =
        pvid_larger_q31(pvid_larger_q31(bits_beyond(y0, factor->up[W]), bits_beyond(y1, factor->up[D1])),
                        bits_beyond(y2, factor->up[D2]));
    const int32_t x0 = lifted(y0, factor->up[W], down);
    const int32_t x1 = lifted(y1, factor->up[D1], down) - by_l(factor->l01, x0);
    const int32_t x2 = lifted(y2, factor->up[D2], down);
    solution->x[W] = x0;
    solution->x[D1] = x1;
    solution->x[D2] = (x2 - by_l(factor->l02, x0)) - by_l(factor->l12, x1);
    solution->exponent = (solution->of_b - (int32_t)L_BITS) + down;
}

/* ---- law ---- */

/* Sum of gradient times e since the last solve, in the units and format of F. */
static int64_t fresh_force(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system, size_t a,
                           int32_t of_column)
{
    const int32_t of_row = system->scale_a + (2 * system->time);
    const int32_t shift = (of_column + of_row + (2 * (int32_t)self->exponent)) - 30;
    return pvid_clamp_q31(pvid_scale_q31(self->fresh[a], shift), FORCE_MAX);
}

/* sum gradient e + g (F - sum gradient e). */
static void drive(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                  int64_t f[PVID_KAPITZA_P])
{
    const int32_t gain = self->settings.gain;
    if (gain == PVID_ONE_Q30) {
        return;
    }
    const int32_t t = system->time;
    const int32_t of_column[PVID_KAPITZA_P] = {system->scale_a + t, system->scale_x + (3 * t),
                                               system->scale_z + (4 * t)};
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const int64_t fresh = fresh_force(self, system, a, of_column[a]);
        f[a] = (gain == 0) ? fresh : (fresh + pvid_times_q31(f[a] - fresh, 2 * gain));
    }
}

/* ---- dead zone ---- */

/* F^T (S + H0)^-1 F in the unit of the sums. */
static pvid_scaled_q31 decrement_of(const pvid_kapitza_system_q31 *system, const solutions *solution)
{
    pvid_scaled_q31 sum = {0, 0};
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const pvid_scaled_q31 b = pvid_scaled_of_q31(solution->b[a], solution->of_b);
        const pvid_scaled_q31 x = pvid_scaled_of_q31(solution->x[a], solution->exponent);
        sum = pvid_scaled_plus_q31(sum, pvid_scaled_times_q31(b, x));
    }
    return pvid_scaled_shifted_q31(sum, 2 * (system->scale_a + (2 * system->time)));
}

PVID_COLD static bool is_in_dead_zone(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                                      const factors *factor)
{
    solutions solution;
    const pvid_scaled_q31 unknown = {0, 0};
    const pvid_residual_q31 residual = {pvid_kapitza_residual_q31(self), self->sums[PVID_SUM_WEIGHT], self->exponent};
    solve_for(factor, system->f, &solution);
    return pvid_step_is_in_dead_zone_q31(&residual, &self->settings, unknown, decrement_of(system, &solution));
}

/* ---- step ---- */

/* Largest |dp| of a step that is not shortened. */
static int32_t reach_of(const pvid_kapitza_estimator_q31 *self, size_t a)
{
    return (int32_t)pvid_floor_shift_q31(pvid_product_q31(self->p[a], (int32_t)self->settings.step_limit), 16);
}

PVID_COLD static void take_long_step(pvid_kapitza_estimator_q31 *self, const int64_t dp[])
{
    pvid_solution_q31 solution = {.p = self->p};
    pvid_step_take_q31(&self->settings, self->p, dp, &solution);
    pvid_count_step(&self->counters, solution.limited, solution.bounded);
}

/* p + dp within its bounds, |dp| < p: below 2^32. */
static int32_t bounded(const pvid_kapitza_estimator_q31 *self, size_t a, int32_t dp, bool *stopped)
{
    const uint32_t x = (uint32_t)((int64_t)self->p[a] + dp);
    const uint32_t lower = (uint32_t)self->settings.lower[a];
    const uint32_t upper = (uint32_t)self->settings.upper[a];
    const uint32_t above = (x < lower) ? lower : x;
    const uint32_t within = (above > upper) ? upper : above;
    *stopped = *stopped || (within != x);
    return (int32_t)within;
}

PVID_NOINLINE static void take_step(pvid_kapitza_estimator_q31 *self, const int64_t dp[])
{
    bool is_long = false;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const int32_t reach = reach_of(self, a);
        is_long = is_long || (dp[a] > reach) || (dp[a] < -(int64_t)reach);
    }
    if (is_long) {
        take_long_step(self, dp);
        return;
    }
    bool stopped = false;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        self->p[a] = bounded(self, a, (int32_t)dp[a], &stopped);
    }
    pvid_count_step(&self->counters, false, stopped);
}

/* Sufficient excitation of w: see pvid_step_is_excited_q31. */
static bool is_excited(const pvid_kapitza_estimator_q31 *self, const factors *factor)
{
    const int32_t kappa_min = self->settings.kappa_min;
    return (kappa_min == 0) ||
           ((factor->p0 >= pvid_part_q31(kappa_min, factor->s00)) && ((factor->p0 / 2) >= factor->prior));
}

PVID_NOINLINE static pvid_reason solve(pvid_kapitza_estimator_q31 *self)
{
    pvid_kapitza_system_q31 system;
    factors factor;
    pvid_kapitza_project_q31(self, &system);
    if (!factorise(self, &system, &factor)) {
        return pvid_count_held(&self->counters, PVID_HELD_SINGULAR);
    }
    if (!is_excited(self, &factor)) {
        return pvid_count_held(&self->counters, PVID_HELD_NOT_EXCITED);
    }
    if ((PVID_DEAD_ZONE != 0) && (self->settings.dead_zone > 0u) && is_in_dead_zone(self, &system, &factor)) {
        pvid_count_up(&self->counters.in_dead_zone);
        return PVID_UPDATED;
    }
    solutions solution;
    drive(self, &system, system.f);
    solve_for(&factor, system.f, &solution);
    const int32_t bits[PVID_KAPITZA_P] = {PVID_KAPITZA_W_BITS + system.time, self->bits[0] - system.of_x,
                                          self->bits[1] - system.of_z};
    int64_t dp[PVID_KAPITZA_P];
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const int32_t up = (solution.exponent - factor.g[a]) + bits[a];
        dp[a] = pvid_clamp_q31(scaled_down(solution.x[a], -up), STEP_MAX);
    }
    take_step(self, dp);
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

pvid_reason pvid_kapitza_estimator_take_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31],
                                            int32_t e, const int32_t gradient[PVID_KAPITZA_P])
{
    pvid_kapitza_add_q31(self, row);
    if (self->settings.gain < PVID_ONE_Q30) {
        for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
            self->fresh[a] = pvid_clamp_q31(self->fresh[a] + pvid_product_q31(gradient[a], e), PVID_WIDE);
        }
    }
    pvid_count_up(&self->counters.rows);
    pvid_reason reason = PVID_ACCUMULATED;
    if (pvid_solve_is_due(&self->phase, self->divider)) {
        reason = solve(self);
        memset(self->fresh, 0, sizeof self->fresh);
    }
    pvid_kapitza_end_row_q31(self);
    return reason;
}
