/* The system S dp = F in integers: M, C and S scaled by powers of two such that 30 bits hold all that matters. */
#include "solve/system_q31.h"
#include "number/scaled_q31.h"
#include "solve/scaled_model_q31.h"

/* Entries of M after which a call of pvid_system_scale_rows_q31 stops at the end of a row. */
#define ENTRIES_PER_STAGE 18u

/* Far beyond the exponents of the information of noise. */
#define EXPONENT_MAX 5000

void pvid_system_exponents_q31(const pvid_information_q31 *information, const pvid_model_q31 *model, int16_t h[])
{
    const int64_t *diagonal = information->sums;
    size_t kind = 0;
    size_t end = pvid_information_end_of_q31(model, 0);
    for (size_t i = 0; i < model->n_theta; i++) {
        if (i == end) {
            kind++;
            end = pvid_information_end_of_q31(model, kind);
        }
        h[i] = (int16_t)pvid_half_exponent_q31(*diagonal);
        diagonal += end - i; /* entries of row i of its block */
    }
}

/* One past the last row of a stage that starts with `row`: some rows of one block. */
static size_t rows_end(const pvid_block *block, size_t row)
{
    const size_t all = block->first + block->n;
    size_t entries = 0;
    size_t end = row;
    while ((end < all) && (entries < ENTRIES_PER_STAGE)) {
        entries += all - end;
        end++;
    }
    return end;
}

size_t pvid_system_rows_end_q31(const pvid_model_q31 *model, size_t row)
{
    pvid_block block;
    pvid_information_block_q31(model, row, &block);
    return rows_end(&block, row);
}

size_t pvid_system_scale_rows_q31(const pvid_information_q31 *information, const pvid_model_q31 *model,
                                  const int16_t h[], size_t row, int32_t m[])
{
    pvid_block block;
    pvid_information_block_q31(model, row, &block);
    const size_t all = block.first + block.n;
    const size_t end = rows_end(&block, row);
    size_t at = block.moment + pvid_moment_q31(block.n, row - block.first, row - block.first);
    for (size_t i = row; i < end; i++) {
        for (size_t j = i; j < all; j++) {
            m[at] = (int32_t)pvid_clamp_q31(pvid_scale_q31(information->sums[at], h[i] + h[j]), PVID_ONE_Q30);
            at++;
        }
    }
    return end;
}

size_t pvid_system_row_stages_q31(const pvid_model_q31 *model)
{
    size_t stages = 0;
    size_t row = 0;
    while ((row < model->n_theta) && (stages < model->n_theta)) { /* a row at least each */
        pvid_block block;
        pvid_information_block_q31(model, row, &block);
        row = rows_end(&block, row);
        stages++;
    }
    return stages;
}

/* The largest sums are over entries of C and M, C and right-hand sides, steps and b: with 11 theta they are below
 * 2^63. */
int32_t pvid_system_guard_bits_q31(size_t n_theta)
{
    return (n_theta <= 11u) ? 0 : ((n_theta <= 22u) ? 1 : 2);
}

void pvid_system_jacobian_q31(const pvid_estimator_q31 *self, const int16_t h[], int32_t c[], int16_t f[])
{
    const pvid_model_q31 *model = self->model;
    int64_t value[PVID_MAX_C_Q31];
    int32_t exponent[PVID_MAX_C_Q31];
    int32_t largest[PVID_MAX_P];
    for (size_t k = 0; k < model->n_c; k++) {
        exponent[k] = (int32_t)self->c_exponent[k] + h[model->c_row[k]];
    }
    if (model->scaled != NULL) {
        model->scaled->adapter->jacobian(self, value, exponent);
    } else {
        model->jacobian(self->p, value);
    }
    for (size_t a = 0; a < model->n_p; a++) {
        largest[a] = PVID_ZERO_EXPONENT_Q31;
    }
    for (size_t k = 0; k < model->n_c; k++) {
        const int32_t length = pvid_length_q31(value[k]) + exponent[k];
        const size_t a = model->c_column[k];
        largest[a] = (length > largest[a]) ? length : largest[a];
    }
    const int32_t bits = 29 - pvid_system_guard_bits_q31(model->n_theta);
    for (size_t a = 0; a < model->n_p; a++) {
        f[a] = (int16_t)(largest[a] - bits);
    }
    for (size_t k = 0; k < model->n_c; k++) {
        c[k] = (int32_t)pvid_clamp_q31(pvid_scale_q31(value[k], f[model->c_column[k]] - exponent[k]), PVID_ONE_Q30 / 2);
    }
}

/* t += 2^-32 m e_j a for the symmetric m, packed upper triangle by rows; each product rounded down. */
static inline void add_column(size_t n, const int32_t m[], size_t j, int32_t a, int32_t t[])
{
    size_t at = j;
    for (size_t i = 0; i < j; i++) {
        t[i] += pvid_upper_product_q31(m[at], a);
        at += (n - 1u) - i;
    }
    for (size_t i = j; i < n; i++) {
        t[i] += pvid_upper_product_q31(m[at], a);
        at++;
    }
}

size_t pvid_system_project_q31(const pvid_model_q31 *model, const int32_t m[], const int32_t c[], size_t start,
                               int64_t s[])
{
    const size_t end = pvid_column_end_q31(model, start);
    int32_t t[PVID_MAX_THETA_Q31] = {0}; /* 2^-PVID_S_BITS m c_a */
    pvid_block block = {0, 0, 0};
    for (size_t k = start; k < end; k++) {
        const size_t row = model->c_row[k];
        if (row >= (block.first + block.n)) { /* they ascend */
            pvid_information_block_q31(model, row, &block);
        }
        add_column(block.n, &m[block.moment], row - block.first, c[k], &t[block.first]);
    }
    for (size_t b = model->c_column[start]; b < model->n_p; b++) {
        s[b] = 0;
    }
    for (size_t k = start; k < model->n_c; k++) {
        s[model->c_column[k]] += pvid_short_product_q31(c[k], t[model->c_row[k]]);
    }
    return end;
}

int32_t pvid_square_ratio_q31(int32_t sd, int32_t exponent, int32_t start_sd, int32_t *prior)
{
    const int64_t ratio = (int64_t)pvid_quotient_q31((uint64_t)sd << 31, (uint32_t)start_sd);
    const int32_t up = 31 - (int32_t)pvid_bit_length_q31((uint64_t)ratio);
    const int64_t mantissa = pvid_clamp_q31(pvid_scale_q31(ratio, -up), (int64_t)1 << 31); /* 31 bits, rounded */
    *prior = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(mantissa * mantissa, 31), INT32_MAX);
    return (2 * ((31 + up) - exponent)) - 31;
}

int64_t pvid_system_prior_q31(int32_t prior, int32_t prior_exponent, int32_t f)
{
    const int64_t scaled = pvid_scale_q31(prior, prior_exponent + (2 * f) + PVID_S_BITS);
    return (scaled > (PVID_WIDE / 2)) ? (PVID_WIDE / 2) : scaled;
}

void pvid_system_equilibrate_q31(uint8_t n_p, const int64_t s[][PVID_MAX_P], int16_t g[], int32_t q[][PVID_MAX_P])
{
    for (size_t a = 0; a < n_p; a++) {
        g[a] = (int16_t)pvid_half_exponent_q31(s[a][a]);
    }
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a; b < n_p; b++) {
            q[a][b] = (int32_t)pvid_clamp_q31(pvid_scale_q31(s[a][b], g[a] + g[b]), PVID_ONE_Q30);
        }
    }
}

void pvid_system_begin_factor_q31(pvid_system_q31 *system, uint8_t n_p, const int64_t s[][PVID_MAX_P])
{
    pvid_system_equilibrate_q31(n_p, s, system->g, system->q);
    pvid_cholesky_begin_q31(&system->factor, n_p);
}

void pvid_system_eliminate_q31(pvid_system_q31 *system, size_t n_p, size_t part)
{
    const size_t first = part * PVID_PIVOTS_PER_PART;
    const size_t end = ((n_p - first) > PVID_PIVOTS_PER_PART) ? (first + PVID_PIVOTS_PER_PART) : n_p;
    for (size_t eliminated = first; eliminated < end; eliminated++) {
        pvid_cholesky_eliminate_q31(&system->factor, (const int32_t (*)[PVID_MAX_P])system->q, (n_p - 1u) - eliminated);
    }
}

void pvid_system_without_noise_q31(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve,
                                   int64_t rest[][PVID_MAX_P])
{
    const int64_t weight = self->information.sums[self->information.n_sums - 1u];
    const int64_t sd = self->settings.row_sd;
    const pvid_scaled_q31 row = pvid_scaled_of_q31(sd * sd, -2 * PVID_ROW_SD_BITS);
    const pvid_scaled_q31 tables =
        pvid_scaled_over_q31(pvid_scaled_of_q31(weight, -16), pvid_scaled_of_q31((int64_t)self->noise_rows, 0));
    const pvid_scaled_q31 margin = pvid_scaled_of_q31((int64_t)self->settings.noise_margin, -16);
    pvid_scaled_q31 much =
        pvid_scaled_times_q31(pvid_scaled_times_q31(margin, tables), pvid_scaled_over_q31(solve->variance, row));
    much.e = (int32_t)pvid_clamp_q31(much.e, EXPONENT_MAX);
    size_t at = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        for (size_t b = a; b < self->model->n_p; b++) {
            const pvid_scaled_q31 noise = pvid_scaled_times_q31(much, pvid_scaled_unpacked_q31(self->noise_table[at]));
            const int32_t unit = (int32_t)solve->now.system.f[a] + solve->now.system.f[b] + PVID_S_BITS;
            rest[a][b] = pvid_clamp_q31(solve->now.system.s[a][b] - pvid_scaled_fixed_q31(noise, -unit), PVID_WIDE);
            at++;
        }
    }
}
