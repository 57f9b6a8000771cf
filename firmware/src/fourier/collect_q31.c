#include "fourier/collect_q31.h"

#include <stddef.h>

#include "fourier/sums_q31.h"
#include "fourier/values_q31.h"

/* Ticks of a block of four steps that add harmonics or run stages. */
static uint32_t other_ticks(const pvid_fourier_design_q31 *design)
{
    return 4u * ((design->decimation > 1u) ? (design->decimation - 1u) : 1u);
}

/* Harmonics that a tick adds or joins, such that a block that ends a window is added and joined before the next one. */
static uint32_t items(const pvid_fourier_design_q31 *design)
{
    const uint32_t ticks = other_ticks(design);
    return ((2u * (uint32_t)pvid_fourier_harmonics_q31(design)) + (ticks - 1u)) / ticks;
}

bool pvid_fourier_blocks_fit_q31(const pvid_fourier_design_q31 *design)
{
    return (PVID_MAX_BLOCKS > 1) ||
           (((other_ticks(design) / 4u) * items(design)) >= (2u * (uint32_t)pvid_fourier_harmonics_q31(design)));
}

/* The blocks of a half but the one in which the window is joined have ticks without harmonics. */
uint32_t pvid_fourier_free_ticks_q31(const pvid_fourier_design_q31 *design)
{
    const uint32_t each = items(design);
    const uint32_t adding = (pvid_fourier_harmonics_q31(design) + (each - 1u)) / each;
    return ((design->hop / (uint32_t)PVID_FOURIER_BLOCK_Q31) - 1u) * (other_ticks(design) - adding);
}

void pvid_fourier_collect_init_q31(pvid_fourier_collect_q31 *self, const pvid_fourier_design_q31 *design,
                                   const int32_t offset[])
{
    self->design = design;
    self->items_per_tick = (uint8_t)items(design);
    pvid_fourier_front_init_q31(&self->front, design, offset);
    pvid_fourier_values_init_q31(&self->values, pvid_fourier_front_lead_q31(&self->front));
    pvid_fourier_collect_reset_q31(self);
}

void pvid_fourier_collect_reset_q31(pvid_fourier_collect_q31 *self)
{
    pvid_fourier_front_reset_q31(&self->front);
    pvid_fourier_values_reset_q31(&self->values);
    pvid_fourier_sums_reset_q31(&self->sums);
}

/* Some harmonics of the block that is being added. */
pvid_fourier_tick pvid_fourier_collect_work_q31(pvid_fourier_collect_q31 *self)
{
    for (uint32_t i = self->items_per_tick; (i > 0u) && (self->sums.left > 0u); i--) {
        pvid_fourier_sums_item_q31(&self->sums, self->design, &self->values, &self->window);
    }
    return ((self->sums.left == 0u) && self->sums.joins) ? PVID_FOURIER_WINDOW : PVID_FOURIER_BUSY;
}

pvid_fourier_tick pvid_fourier_collect_end_q31(pvid_fourier_collect_q31 *self)
{
    const pvid_fourier_design_q31 *design = self->design;
    const uint16_t index = self->values.index;
    int32_t jet[PVID_MAX_INPUTS];
    if (pvid_fourier_front_step_q31(&self->front, design, jet)) {
        int32_t *place = pvid_fourier_sums_place_q31(&self->sums, index);
        const pvid_fourier_outcome outcome = pvid_fourier_values_step_q31(&self->values, design, jet, place);
        if (outcome == PVID_FOURIER_BEYOND) {
            pvid_fourier_collect_reset_q31(self);
            return PVID_FOURIER_REJECTED;
        }
        if (outcome == PVID_FOURIER_CHANNELS) {
            pvid_fourier_sums_next_q31(&self->sums, design, index, self->values.half);
            pvid_fourier_values_next_q31(&self->values, design->hop);
        }
    }
    if (design->decimation > 1u) {
        return PVID_FOURIER_BUSY;
    }
    return (self->sums.left > 0u) ? pvid_fourier_collect_work_q31(self) : PVID_FOURIER_FREE;
}
