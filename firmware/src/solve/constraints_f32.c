#include "number/uncontracted.h"

#include "solve/constraints_f32.h"

#include <string.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/elementary.h"

#if PVID_MAX_CONSTRAINTS > 0

#define WIDTH (1u + PVID_MAX_P)

/* An entry below this part of its constraint's largest is rounding of an elimination: the constraint is redundant. */
#define REDUNDANT 1.0e-5f

/* Weight of a pivot at a bound: it is the last choice. */
#define AT_BOUND 9.765625e-4f

/* A constraint is met within this part of a large step. */
#define MET 1.0e-4f

/* Of a step that leads too far from the constraints. */
#define HALVINGS 4u

/* A large step of a parameter: itself where positive, else start_sd. */
static float reach_of(const pvid_solve_settings_f32 *settings, const float p[], size_t a)
{
    const bool positive = (((uint32_t)settings->positive >> a) & 1u) != 0u;
    return positive ? p[a] : settings->start_sd[a];
}

static bool is_dependent(const pvid_constraints_f32 *self, size_t a)
{
    return (((uint32_t)self->dependent >> a) & 1u) != 0u;
}

/* The largest entry, in large steps over `length`, of the rows from `first` on and the parameters that are independent
 * so far; writes its place. */
static float largest(const pvid_constraints_f32 *self, size_t m, size_t n, float rows[][WIDTH], const float length[],
                     const float weight[], size_t *row, size_t *column)
{
    float most = 0.0f;
    for (size_t k = self->count; k < m; k++) {
        for (size_t a = 0; a < n; a++) {
            const float size =
                is_dependent(self, a) ? 0.0f : ((pvid_magnitude_f32(rows[k][1u + a]) * weight[a]) / length[k]);
            if (size > most) {
                most = size;
                *row = k;
                *column = a;
            }
        }
    }
    return most;
}

/* Row `of` is solved for its parameter and put into all others. */
static void eliminate(size_t m, size_t n, float rows[][WIDTH], size_t of, size_t column)
{
    const float pivot = rows[of][1u + column];
    for (size_t a = 0; a < n + 1u; a++) {
        rows[of][a] /= pivot;
    }
    for (size_t k = 0; k < m; k++) {
        const float factor = rows[k][1u + column];
        for (size_t a = 0; (k != of) && (a < n + 1u); a++) {
            rows[k][a] -= factor * rows[of][a];
        }
        if (k != of) {
            rows[k][1u + column] = 0.0f;
        }
    }
}

static void swap_rows(float rows[][WIDTH], float length[], size_t a, size_t b)
{
    for (size_t i = 0; i < WIDTH; i++) {
        const float held = rows[a][i];
        rows[a][i] = rows[b][i];
        rows[b][i] = held;
    }
    const float held = length[a];
    length[a] = length[b];
    length[b] = held;
}

PVID_COLD void pvid_constraints_at_f32(pvid_constraints_f32 *self, const pvid_model_f32 *model,
                                       const pvid_solve_settings_f32 *settings, const float p[])
{
    const size_t m = model->n_constraints;
    const size_t n = model->n_p;
    float flat[PVID_MAX_CONSTRAINTS * (1u + PVID_MAX_P)];
    float rows[PVID_MAX_CONSTRAINTS][WIDTH];
    float length[PVID_MAX_CONSTRAINTS] = {0.0f}; /* compilers do not see that all of them are written */
    float weight[PVID_MAX_P];
    memset(self, 0, sizeof *self);
    model->constraints(p, flat);
    for (size_t a = 0; a < n; a++) {
        const bool at_bound = (p[a] <= settings->lower[a]) || (p[a] >= settings->upper[a]);
        weight[a] = reach_of(settings, p, a) * (at_bound ? AT_BOUND : 1.0f);
    }
    for (size_t k = 0; k < m; k++) {
        length[k] = PVID_LEAST_NORMAL_F32;
        for (size_t a = 0; a < n + 1u; a++) {
            rows[k][a] = flat[(k * (n + 1u)) + a];
        }
        for (size_t a = 0; a < n; a++) {
            const float size = pvid_magnitude_f32(rows[k][1u + a]) * reach_of(settings, p, a);
            length[k] = (size > length[k]) ? size : length[k];
        }
        self->off += pvid_magnitude_f32(rows[k][0]) / length[k];
    }
    size_t row = 0;
    size_t column = 0;
    while ((self->count < m) && (self->count < n) &&
           (largest(self, m, n, rows, length, weight, &row, &column) > REDUNDANT)) {
        swap_rows(rows, length, self->count, row);
        eliminate(m, n, rows, self->count, column);
        self->place[self->count] = (uint8_t)column;
        self->dependent = (pvid_p_bits)((uint32_t)self->dependent | ((uint32_t)1u << column));
        self->count++;
    }
    for (size_t k = 0; k < self->count; k++) {
        self->rest[k] = -rows[k][0];
        for (size_t a = 0; a < n; a++) {
            self->slope[k][a] = is_dependent(self, a) ? 0.0f : rows[k][1u + a];
        }
    }
}

static float entry(const float s[][PVID_MAX_P], size_t a, size_t b)
{
    return (a < b) ? s[a][b] : s[b][a];
}

void pvid_constraints_shift_f32(const pvid_constraints_f32 *self, size_t n, const float s[][PVID_MAX_P], float force[])
{
    for (size_t k = 0; k < self->count; k++) {
        for (size_t a = 0; a < n; a++) {
            force[a] -= entry(s, a, self->place[k]) * self->rest[k];
        }
    }
}

void pvid_constraints_project_f32(const pvid_constraints_f32 *self, size_t n, float s[][PVID_MAX_P], float force[])
{
    float of_place[PVID_MAX_P];
    for (size_t k = 0; k < self->count; k++) {
        const float *slope = self->slope[k];
        const size_t place = self->place[k];
        for (size_t a = 0; a < n; a++) {
            of_place[a] = entry((const float (*)[PVID_MAX_P])s, a, place);
        }
        for (size_t a = 0; a < n; a++) {
            for (size_t b = a; b < n; b++) {
                const float change =
                    (slope[a] * of_place[b]) + (slope[b] * (of_place[a] - (slope[a] * of_place[place])));
                const bool own = (a == place) || (b == place);
                s[a][b] = own ? 0.0f : (s[a][b] - change);
            }
        }
        for (size_t a = 0; (force != NULL) && (a < n); a++) {
            force[a] -= (a == place) ? 0.0f : (slope[a] * force[place]);
        }
        if (force != NULL) {
            force[place] = 0.0f;
        }
    }
}

void pvid_constraints_reduce_f32(pvid_system_f32 *system, const pvid_model_f32 *model,
                                 const pvid_solve_settings_f32 *settings, const float p[])
{
    const size_t n_p = settings->n_p;
    system->ties.count = 0;
    if (model->n_constraints == 0u) {
        return;
    }
    pvid_constraints_at_f32(&system->ties, model, settings, p);
    pvid_constraints_shift_f32(&system->ties, n_p, (const float (*)[PVID_MAX_P])system->s, system->force);
    pvid_constraints_project_f32(&system->ties, n_p, system->s, system->force);
    for (size_t k = 0; k < system->ties.count; k++) {
        const size_t place = system->ties.place[k];
        system->s[place][place] = 3.0f * settings->prior[place];
    }
}

void pvid_constraints_complete_f32(const pvid_constraints_f32 *self, size_t n, float dp[])
{
    for (size_t k = 0; k < self->count; k++) {
        float sum = self->rest[k];
        for (size_t a = 0; a < n; a++) {
            sum -= self->slope[k][a] * (is_dependent(self, a) ? 0.0f : dp[a]);
        }
        dp[self->place[k]] = sum;
    }
}

PVID_COLD void pvid_constraints_spread_f32(const pvid_constraints_f32 *self, size_t n, float covariance[][PVID_MAX_P])
{
    for (size_t k = 0; k < self->count; k++) {
        const size_t place = self->place[k];
        float own = 0.0f;
        for (size_t a = 0; a < n; a++) {
            float sum = 0.0f;
            for (size_t b = 0; b < n; b++) {
                sum -= self->slope[k][b] * covariance[b][a];
            }
            covariance[place][a] = sum;
        }
        for (size_t a = 0; a < n; a++) {
            own -= self->slope[k][a] * covariance[place][a];
        }
        for (size_t a = 0; a < n; a++) {
            covariance[a][place] = covariance[place][a];
        }
        covariance[place][place] = (own > 0.0f) ? own : 0.0f;
    }
}

PVID_COLD bool pvid_constraints_return_f32(const pvid_model_f32 *model, const pvid_solve_settings_f32 *settings,
                                           float p[], size_t steps)
{
    pvid_constraints_f32 ties;
    pvid_constraints_at_f32(&ties, model, settings, p);
    for (size_t left = steps; left > 0u; left--) {
        for (size_t k = 0; k < ties.count; k++) {
            const size_t a = ties.place[k];
            const float moved = p[a] + ties.rest[k];
            const float raised = (moved > settings->lower[a]) ? moved : settings->lower[a];
            p[a] = (raised < settings->upper[a]) ? raised : settings->upper[a];
        }
        pvid_constraints_at_f32(&ties, model, settings, p);
    }
    return ties.off <= MET;
}

bool pvid_constraints_end_f32(const pvid_model_f32 *model, const pvid_solve_settings_f32 *settings,
                              const float before[], float p[])
{
    const size_t n_p = settings->n_p;
    float whole[PVID_MAX_P];
    float part = 1.0f;
    for (size_t a = 0; a < n_p; a++) {
        whole[a] = p[a] - before[a];
    }
    for (size_t left = HALVINGS; left > 0u; left--) {
        if (pvid_constraints_return_f32(model, settings, p, PVID_RETURNS_OF_STEP)) {
            return true;
        }
        part *= 0.5f;
        for (size_t a = 0; a < n_p; a++) {
            p[a] = before[a] + (part * whole[a]);
        }
    }
    memcpy(p, before, n_p * sizeof p[0]);
    return false;
}

#endif
