#include "number/uncontracted.h"

#include "kapitza_estimator_f32.h"

#include <stddef.h>
#include <string.h>

#include "kapitza_project_f32.h"
#include "kapitza_row_f32.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "solve/assess_f32.h"
#include "solve/settings_f32.h"

/* Rounding of yy - 2 B^T theta + theta^T M theta, relative to yy: a few ulp of each term. */
#define RESIDUAL_FLOOR 4.8e-7f

/* Most rows between folds: long enough to be cheap, short enough that `low` keeps 17 bits of a row's terms. */
#define FOLD_MAX 64u

/* A sixteenth of the time constant of forgetting, in rows. */
#define FOLDS_PER_CONSTANT 16.0f

/* Rows between exact projections, where no other number is configured. */
#define EXACT_EVERY 8u

/* ---- configuration ---- */

static void prepare_folds(pvid_strong_estimator_f32 *self, float forgetting_rows)
{
    uint32_t rows = FOLD_MAX;
    if ((forgetting_rows > 0.0f) && (forgetting_rows < (FOLDS_PER_CONSTANT * (float)FOLD_MAX))) {
        rows = (uint32_t)(forgetting_rows / FOLDS_PER_CONSTANT);
    }
    const uint32_t unit = (self->staged != 0u) ? self->config->estimator.divider
                                               : PVID_STRONG_ROWS; /* rows from one chance to the next */
    rows = (rows < unit) ? unit : (rows - (rows % unit));
    self->fold_every = (uint8_t)rows;
    self->sums.retention = 1.0f;
    if (forgetting_rows > 0.0f) {
        self->sums.retention = pvid_settings_decay_f32((float)rows / forgetting_rows);
    }
}

static uint8_t exact_every_of(const pvid_strong_config_f32 *config)
{
    const pvid_estimator_config_f32 *estimator = &config->estimator;
    if (estimator->dead_zone > 0.0f) {
        return 1;
    }
    if (config->exact_every > 0u) {
        return (uint8_t)config->exact_every;
    }
    return (estimator->law == PVID_LAW_PSEUDOVELOCITY) ? 1u : EXACT_EVERY;
}

PVID_COLD pvid_status pvid_kapitza_estimator_init_f32(pvid_strong_estimator_f32 *self,
                                                      const pvid_strong_config_f32 *config, float rate_hz)
{
    const pvid_estimator_config_f32 *estimator = &config->estimator;
    const pvid_status status = pvid_settings_are_valid_f32(estimator, PVID_KAPITZA_P, 7u, rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    if (!pvid_within_f32(estimator->row_weight, 1.0f, 1.0f)) {
        return PVID_BAD_ROW_WEIGHT;
    }
    if (config->exact_every > UINT8_MAX) {
        return PVID_BAD_DIVIDER;
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        const float ratio = estimator->row_sd / estimator->start_sd[a];
        self->p[a] = estimator->start[a];
        const float square = ratio * ratio;
        /* not 0: row_variance over it is the square of a start_sd */
        self->prior[a] = (square > PVID_LEAST_NORMAL_F32) ? square : PVID_LEAST_NORMAL_F32;
    }
    const float forgetting_rows = estimator->forgetting_s * rate_hz;
    const uint32_t divider = estimator->divider;
    self->config = config;
    self->exact_every = exact_every_of(config);
    const float interval = (float)((divider > 1u) ? divider : self->exact_every);
    self->gain = pvid_settings_gain_f32(estimator, rate_hz, interval);
    const bool long_enough = (forgetting_rows <= 0.0f) || (forgetting_rows >= (float)divider);
    self->staged = ((divider % PVID_STRONG_ROWS) == 0u) && (divider >= (2u * PVID_STRONG_ROWS)) &&
                   (divider <= FOLD_MAX) && !(estimator->dead_zone > 0.0f) && long_enough;
    self->mixes = self->gain < 1.0f;
    prepare_folds(self, forgetting_rows);
    return PVID_OK;
}

/* ---- the equations from all rows ---- */

/* Adds the first rows of the block to S and F. Returns the sum of their squared residuals. */
static inline float add_block(const pvid_strong_estimator_f32 *self, size_t rows, const float p[3], float s[6],
                              float force[3])
{
    float squares = 0.0f;
    for (size_t i = 0; i < rows; i++) {
        float g[PVID_KAPITZA_P];
        const float e = pvid_kapitza_innovate_f32(p, &self->block[i], g);
        squares += e * e;
        pvid_kapitza_add_squares_f32(g, s);
        pvid_kapitza_add_products_f32(g, e, force);
    }
    return squares;
}

void pvid_kapitza_gather_f32(const pvid_strong_estimator_f32 *self, size_t rows, float s[6], float force[3])
{
    const float p[PVID_KAPITZA_P] = {self->p[0], self->p[1], self->p[2]};
    float all_s[6];
    float all_force[PVID_KAPITZA_P];
    pvid_kapitza_project_f32(&self->sums, p, all_s, all_force);
    (void)add_block(self, rows, p, all_s, all_force);
    PVID_UNROLL
    for (size_t i = 0; i < 6u; i++) {
        s[i] = all_s[i];
    }
    PVID_UNROLL
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        force[a] = all_force[a];
    }
}

/* theta^T M theta - 2 theta^T B at p from the sums alone, by their S and F: with N^T theta = Q + d1 n_1 + d2 n_2 and Q
 * = w A + w^2 E it is <Q (Q - 2 Y)> - sum_a d_a (<n_a (Y - Q)> + F_a). */
static float rss_minus_yy(const pvid_strong_estimator_f32 *self, const float s[6], const float force[3])
{
    const float w = self->p[PVID_KAPITZA_W];
    const float d1 = self->p[PVID_KAPITZA_D1];
    const float d2 = self->p[PVID_KAPITZA_D2];
    const float w2 = w * w;
    const float aa = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_AA);
    const float ae = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_AE);
    const float ee = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_EE);
    const float ya = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_YA);
    const float ye = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_YE);
    const float q_q = (w * ((w * aa) + (w2 * ae))) + (w2 * ((w * ae) + (w2 * ee)));
    const float q_y = (w * ya) + (w2 * ye);
    const float r_1 = force[1] + ((d1 * s[3]) + (d2 * s[4]));
    const float r_2 = force[2] + ((d1 * s[4]) + (d2 * s[5]));
    return (q_q - (2.0f * q_y)) - ((d1 * (r_1 + force[1])) + (d2 * (r_2 + force[2])));
}

PVID_COLD void pvid_kapitza_gather_residuals_f32(const pvid_strong_estimator_f32 *self, float s[6], float force[3],
                                                 pvid_kapitza_residual_f32 *residual)
{
    const float yy = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_YY);
    pvid_kapitza_gather_f32(self, 0, s, force);
    const float of_sums = yy + rss_minus_yy(self, s, force);
    residual->rss = of_sums + add_block(self, self->in_block, self->p, s, force);
    residual->floor = RESIDUAL_FLOOR * yy;
    residual->weight = pvid_kapitza_sum_f32(&self->sums, PVID_SUM_WEIGHT) + (float)self->in_block;
}

/* ---- accuracy ---- */

static void settings_of(const pvid_strong_estimator_f32 *self, pvid_solve_settings_f32 *settings)
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    memset(settings, 0, sizeof *settings);
    settings->row_variance = config->row_sd * config->row_sd;
    settings->correlation = config->correlation;
    settings->dead_zone = config->dead_zone * config->dead_zone;
    settings->n_p = PVID_KAPITZA_P;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        settings->prior[a] = self->prior[a];
        settings->start_sd[a] = sqrtf(settings->row_variance / self->prior[a]);
    }
}

static void system_of(const pvid_kapitza_residual_f32 *residual, pvid_system_f32 *system)
{
    system->rss = residual->rss;
    system->rounding = 0.0f;
    system->floor = residual->floor;
    system->weight = residual->weight;
}

PVID_COLD void pvid_kapitza_assess_f32(const pvid_strong_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    float s[6];
    pvid_kapitza_residual_f32 residual;
    pvid_system_f32 system;
    pvid_solve_settings_f32 settings;
    settings_of(self, &settings);
    pvid_kapitza_gather_residuals_f32(self, s, system.force, &residual);
    system_of(&residual, &system);
    size_t next = 0;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        for (size_t b = a; b < PVID_KAPITZA_P; b++) {
            system.s[a][b] = s[next];
            next++;
        }
    }
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof self->p);
    pvid_assess_f32(&system, &settings, estimate);
}

PVID_COLD bool pvid_kapitza_is_at_rest_f32(const pvid_strong_estimator_f32 *self, float square,
                                           const pvid_kapitza_residual_f32 *residual)
{
    pvid_system_f32 system;
    pvid_solve_settings_f32 settings;
    settings_of(self, &settings);
    system_of(residual, &system);
    const float variance = pvid_assess_variance_f32(&system, &settings);
    const float noise = (variance < settings.row_variance) ? variance : settings.row_variance;
    return square <= (settings.dead_zone * (settings.correlation * noise));
}
