#include "weak/front_q31.h"

#include <stddef.h>

#include "number/integer_q31.h"
#include "weak/schedule.h"

enum { PHI = 0, Y = 1 };

void pvid_weak_front_init_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design)
{
    pvid_weak_job_init(&self->job, design->taps, design->decimation);
}

void pvid_weak_front_reset_q31(pvid_weak_front_q31 *self)
{
    pvid_weak_job_reset(&self->job);
}

static void begin_sums(pvid_weak_front_q31 *self)
{
    self->middle[PHI] = self->ring[self->job.newer][PHI];
    self->middle[Y] = self->ring[self->job.newer][Y];
    self->sum[PHI] = 0;
    self->sum[Y] = 0;
}

/* The pairs of this tick, outwards from the centre, in runs that are contiguous in the ring. A weight times the sum of
 * two differences fits 32 bits by design. */
static void continue_job(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design)
{
    pvid_weak_job *job = &self->job;
    const size_t last = pvid_weak_job_end(job);
    const int32_t middle_phi = 2 * self->middle[PHI];
    const int32_t middle_y = 2 * self->middle[Y];
    int64_t sum_phi = self->sum[PHI];
    int64_t sum_y = self->sum[Y];
    size_t newer = job->newer;
    size_t older = job->older;
    size_t i = job->pair;
    for (uint32_t runs = 0; (runs < PVID_WEAK_JOB_RUNS) && (i < last); runs++) {
        const size_t run = pvid_weak_job_outwards(job, last - i, &newer, &older);
        const int32_t *after = self->ring[newer];
        const int32_t *before = self->ring[older];
        for (const size_t end = i + run; i < end; i++) {
            sum_phi += design->smooth[i] * ((after[PHI] + before[PHI]) - middle_phi);
            sum_y += design->second[i] * ((after[Y] + before[Y]) - middle_y);
            after += 2;
            before -= 2;
        }
        newer += run - 1u;
        older -= run - 1u;
    }
    self->sum[PHI] = sum_phi;
    self->sum[Y] = sum_y;
    job->newer = (uint16_t)newer;
    job->older = (uint16_t)older;
    job->pair = (uint16_t)last;
}

bool pvid_weak_front_step_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t phi, int32_t y,
                              int32_t *f, int64_t *u)
{
    const pvid_weak_job *job = &self->job;
    self->ring[job->head][PHI] = phi;
    self->ring[job->head][Y] = y;
    if (pvid_weak_job_begins(&self->job)) {
        begin_sums(self);
    }
    if (job->pair == job->half) {
        return false;
    }
    continue_job(self, design);
    if (job->pair < job->half) {
        return false;
    }
    const int64_t smooth = (self->middle[PHI] * ((int64_t)1 << design->smooth_bits)) + self->sum[PHI];
    *f = (int32_t)pvid_round_shift_q31(smooth, design->phi_shift);
    *u = pvid_round_shift_q31(self->sum[Y], design->u_shift);
    return true;
}
