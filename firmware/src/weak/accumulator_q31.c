#include "weak/accumulator_q31.h"

#include <stddef.h>

#include "weak/steps.h"
#include "weak/sums_q31.h"
#include "weak/values_q31.h"

/* Ticks of a block of four steps that add harmonics or run stages. */
static uint32_t other_ticks(const pvid_weak_design_q31 *design)
{
    return 4u * ((design->decimation > 1u) ? (design->decimation - 1u) : 1u);
}

/* Harmonics that a tick adds or joins, such that a block that ends a window is added and joined before the next one. */
static uint32_t items(const pvid_weak_design_q31 *design)
{
    const uint32_t ticks = other_ticks(design);
    return ((2u * (uint32_t)pvid_weak_harmonics_q31(design)) + (ticks - 1u)) / ticks;
}

bool pvid_weak_blocks_fit_q31(const pvid_weak_design_q31 *design)
{
    return (PVID_MAX_BLOCKS > 1) ||
           (((other_ticks(design) / 4u) * items(design)) >= (2u * (uint32_t)pvid_weak_harmonics_q31(design)));
}

/* The blocks of a half but the one in which the window is joined have ticks without harmonics. */
uint32_t pvid_weak_free_ticks_q31(const pvid_weak_design_q31 *design)
{
    const uint32_t each = items(design);
    const uint32_t adding = (pvid_weak_harmonics_q31(design) + (each - 1u)) / each;
    return ((design->hop / (uint32_t)PVID_WEAK_BLOCK_Q31) - 1u) * (other_ticks(design) - adding);
}

uint32_t pvid_weak_ticks_behind_join_q31(const pvid_weak_design_q31 *design)
{
    const uint32_t each = items(design);
    const uint32_t joining = ((2u * (uint32_t)pvid_weak_harmonics_q31(design)) + (each - 1u)) / each;
    const uint32_t all = other_ticks(design);
    return (all > joining) ? (all - joining) : 0u;
}

uint8_t pvid_weak_pace_q31(const pvid_weak_design_q31 *design, uint32_t stages, uint32_t columns)
{
    const uint32_t steps = PVID_WEAK_BLOCK_Q31;
    const uint32_t all = other_ticks(design);
    return pvid_weak_pace(stages, columns, design->hop / steps, steps, all / steps,
                          all - pvid_weak_ticks_behind_join_q31(design));
}

void pvid_weak_accumulator_init_q31(pvid_weak_accumulator_q31 *self, const pvid_weak_design_q31 *design,
                                    const int32_t offset[])
{
    self->design = design;
    self->items_per_tick = (uint8_t)items(design);
    pvid_weak_front_init_q31(&self->front, design, offset);
    pvid_weak_values_init_q31(&self->values, pvid_weak_front_lead_q31(&self->front));
    pvid_weak_accumulator_reset_q31(self);
}

void pvid_weak_accumulator_reset_q31(pvid_weak_accumulator_q31 *self)
{
    pvid_weak_front_reset_q31(&self->front);
    pvid_weak_values_reset_q31(&self->values);
    pvid_weak_sums_reset_q31(&self->sums);
}

/* Some harmonics of the block that is being added. */
pvid_weak_tick pvid_weak_accumulator_work_q31(pvid_weak_accumulator_q31 *self)
{
    for (uint32_t i = self->items_per_tick; (i > 0u) && (self->sums.left > 0u); i--) {
        pvid_weak_sums_item_q31(&self->sums, self->design, &self->values, &self->window);
    }
    return ((self->sums.left == 0u) && self->sums.joins) ? PVID_WEAK_WINDOW : PVID_WEAK_BUSY;
}

pvid_weak_tick pvid_weak_accumulator_end_q31(pvid_weak_accumulator_q31 *self)
{
    const pvid_weak_design_q31 *design = self->design;
    const uint16_t index = self->values.index;
    int32_t jet[PVID_MAX_INPUTS];
    if (pvid_weak_front_step_q31(&self->front, design, jet)) {
        pvid_weak_entry_q31 *place = pvid_weak_sums_place_q31(&self->sums, index);
        const pvid_weak_outcome outcome = pvid_weak_values_step_q31(&self->values, design, jet, place);
        if (outcome == PVID_WEAK_BEYOND) {
            pvid_weak_accumulator_reset_q31(self);
            return PVID_WEAK_REJECTED;
        }
        if (outcome == PVID_WEAK_CHANNELS) {
            pvid_weak_sums_next_q31(&self->sums, design, index, self->values.half);
            pvid_weak_values_next_q31(&self->values, design->hop);
        }
    } else if (!self->values.ran && (PVID_COUNT(PVID_EXACT_RUNS, design->model->runs) > 0u)) {
        bool first = false;
        if (pvid_weak_front_early_q31(&self->front, design, jet, &first)) {
            pvid_weak_values_begin_q31(&self->values, design, jet, first);
        }
    } else {
        /* the line fills */
    }
    if (design->decimation > 1u) {
        return PVID_WEAK_BUSY;
    }
    return (self->sums.left > 0u) ? pvid_weak_accumulator_work_q31(self) : PVID_WEAK_FREE;
}
