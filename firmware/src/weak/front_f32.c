#include "number/uncontracted.h"

#include "weak/front_f32.h"

#include <stddef.h>

#include "weak/schedule.h"

enum { PHI = 0, Y = 1 };

void pvid_weak_front_init_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float sample_rate_hz,
                              float l1)
{
    pvid_weak_job_init(&self->job, design->taps, design->decimation);
    self->smooth = design->smooth;
    self->second = design->second;
    self->u_scale = (sample_rate_hz * sample_rate_hz) / l1;
}

void pvid_weak_front_reset_f32(pvid_weak_front_f32 *self)
{
    pvid_weak_job_reset(&self->job);
}

static void begin_sums(pvid_weak_front_f32 *self)
{
    self->middle[PHI] = self->ring[self->job.newer][PHI];
    self->middle[Y] = self->ring[self->job.newer][Y];
    self->sum[PHI] = 0.0f;
    self->sum[Y] = 0.0f;
}

/* The pairs of this tick, outwards from the centre, in runs that are contiguous in the ring. */
static inline void continue_job(pvid_weak_front_f32 *self)
{
    pvid_weak_job *job = &self->job;
    const size_t last = pvid_weak_job_end(job);
    const float middle_phi = self->middle[PHI];
    const float middle_y = self->middle[Y];
    float sum_phi = self->sum[PHI];
    float sum_y = self->sum[Y];
    size_t newer = job->newer;
    size_t older = job->older;
    size_t i = job->pair;
    for (uint32_t runs = 0; (runs < PVID_WEAK_JOB_RUNS) && (i < last); runs++) {
        const size_t run = pvid_weak_job_outwards(job, last - i, &newer, &older);
        const float *after = self->ring[newer];
        const float *before = self->ring[older];
        for (const size_t end = i + run; i < end; i++) {
            sum_phi += self->smooth[i] * ((after[PHI] - middle_phi) + (before[PHI] - middle_phi));
            sum_y += self->second[i] * ((after[Y] - middle_y) + (before[Y] - middle_y));
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

bool pvid_weak_front_step_f32(pvid_weak_front_f32 *self, float phi, float y, float *smooth_phi, float *u)
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
    continue_job(self);
    if (job->pair < job->half) {
        return false;
    }
    *smooth_phi = self->middle[PHI] + self->sum[PHI];
    *u = self->sum[Y] * self->u_scale;
    return true;
}
