/* The sums of the float estimator: what information.h does not show. Private to the core. */
#ifndef PVID_INFORMATION_F32_H
#define PVID_INFORMATION_F32_H

#include "pvid/information.h"
#include "pvid/model.h"
#include "solve/kinds.h"

/* The block of M that contains entry i of theta. */
static inline void pvid_information_block_f32(const pvid_model_f32 *model, size_t i, pvid_block *block)
{
    block->first = 0;
    block->n = model->n_theta;
    block->moment = 0;
    if (((PVID_EXACT == 0) || (PVID_MAX_KINDS > 1)) && (model->n_kinds > 1u)) {
        pvid_block_among_kinds(model->n_kinds, model->kind_end, i, block);
    }
}

/* Adds a row of the kind with this block: n[block->n]. Cost: one product and
 * one addition per sum of the kind. */
void pvid_information_add_block_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const pvid_block *block,
                                    const float n[], float y);

#endif
