/* A block of D ticks makes a step. Its first half runs the FIR job of the step before, the next tick makes the
 * channels, the others add the last four steps to the harmonics, or are free: at most half of them add. Where D is
 * small each tick does all that is due. */
#include "fourier/collect_q31.h"

#include <stddef.h>

#include "fourier/fourier_front_q31.h"
#include "fourier/sums_q31.h"
#include "fourier/values_q31.h"

/* The least D whose ticks share the work. */
#define SHARING 4u

static uint32_t greater(uint32_t a, uint32_t b)
{
    return (a > b) ? a : b;
}

/* Ticks of a block that run no job and make no channels. */
static uint32_t other_ticks(const pvid_fourier_design_q31 *design)
{
    const uint32_t ticks = design->decimation;
    return (ticks < SHARING) ? ticks : ((ticks - pvid_fourier_front_job_q31(design)) - 1u);
}

/* Harmonics a tick, such that half of the other ticks of four blocks suffice. */
static uint32_t slices(const pvid_fourier_design_q31 *design)
{
    const uint32_t ticks = greater(((uint32_t)PVID_FOURIER_BLOCK_Q31 * other_ticks(design)) / 2u, 1);
    return (pvid_fourier_harmonics_q31(design) + (ticks - 1u)) / ticks;
}

uint32_t pvid_fourier_free_ticks_q31(const pvid_fourier_design_q31 *design)
{
    /* but the block in which the next window is joined */
    const uint32_t blocks = (design->hop / (uint32_t)PVID_FOURIER_BLOCK_Q31) - 1u;
    const uint32_t each = (uint32_t)PVID_FOURIER_BLOCK_Q31 * other_ticks(design);
    const uint32_t adding = (pvid_fourier_harmonics_q31(design) + (slices(design) - 1u)) / slices(design);
    return (design->decimation < SHARING) ? (blocks * each) : (blocks * (each - adding));
}

void pvid_fourier_collect_init_q31(pvid_fourier_collect_q31 *self, const pvid_fourier_design_q31 *design)
{
    self->design = design;
    self->at_once = design->decimation < SHARING;
    self->slices_per_tick = (uint8_t)slices(design);
    pvid_fourier_front_init_q31(&self->front, design);
    pvid_fourier_values_init_q31(&self->values, pvid_fourier_front_lead_q31(design));
    pvid_fourier_collect_reset_q31(self);
}

void pvid_fourier_collect_reset_q31(pvid_fourier_collect_q31 *self)
{
    self->due = false;
    pvid_fourier_front_reset_q31(&self->front, self->design);
    pvid_fourier_values_reset_q31(&self->values);
    pvid_fourier_sums_reset_q31(&self->sums, self->design);
}

static bool are_within(const pvid_fourier_design_q31 *design, const int32_t counts[])
{
    const size_t samples = design->model->samples;
    const int32_t *full_scale = design->full_scale;
    bool within = true;
    for (size_t i = 0; i < samples; i++) {
        /* 0..2 full_scale without the sign */
        within = within && (((uint32_t)counts[i] + (uint32_t)full_scale[i]) <= (2u * (uint32_t)full_scale[i]));
    }
    return within;
}

/* The channels of a step, and the block that they may complete. Returns false for an input beyond its reach. */
static bool make_channels(pvid_fourier_collect_q31 *self)
{
    const pvid_fourier_design_q31 *design = self->design;
    const uint16_t index = self->values.index;
    const uint8_t half = self->values.half;
    int32_t *place = pvid_fourier_sums_place_q31(&self->sums, index);
    const pvid_fourier_outcome outcome = pvid_fourier_values_step_q31(&self->values, design, self->front.value, place);
    self->due = false;
    if (outcome == PVID_FOURIER_CHANNELS) {
        pvid_fourier_sums_next_q31(&self->sums, design, index, half);
        pvid_fourier_values_next_q31(&self->values, design->hop);
    }
    return outcome != PVID_FOURIER_BEYOND;
}

/* Some harmonics of the block that is being added. Returns whether this completes a window. */
static bool add_slices(pvid_fourier_collect_q31 *self)
{
    for (uint32_t i = 0; (i < self->slices_per_tick) && pvid_fourier_sums_are_busy_q31(&self->sums, self->design);
         i++) {
        pvid_fourier_sums_slice_q31(&self->sums, self->design, &self->values, &self->window);
    }
    return self->sums.joins && !pvid_fourier_sums_are_busy_q31(&self->sums, self->design);
}

pvid_fourier_tick pvid_fourier_collect_step_q31(pvid_fourier_collect_q31 *self, const int32_t counts[])
{
    const pvid_fourier_design_q31 *design = self->design;
    if (!are_within(design, counts)) {
        pvid_fourier_collect_reset_q31(self);
        return PVID_FOURIER_REJECTED;
    }
    const bool makes = self->due;
    const bool was_busy = pvid_fourier_front_is_busy_q31(&self->front, design);
    const bool completes = pvid_fourier_front_step_q31(&self->front, design, counts);
    self->due = self->due || completes;
    if (makes || (self->at_once && completes)) {
        if (!make_channels(self)) {
            pvid_fourier_collect_reset_q31(self);
            return PVID_FOURIER_REJECTED;
        }
    }
    if (!self->at_once && (makes || was_busy || completes || pvid_fourier_front_is_busy_q31(&self->front, design))) {
        return PVID_FOURIER_BUSY;
    }
    if (pvid_fourier_sums_are_busy_q31(&self->sums, design)) {
        if (add_slices(self)) {
            return PVID_FOURIER_WINDOW;
        }
        return self->at_once ? PVID_FOURIER_FREE : PVID_FOURIER_BUSY;
    }
    return PVID_FOURIER_FREE;
}
