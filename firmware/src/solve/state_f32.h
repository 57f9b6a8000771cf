/* Shared by all parts of the estimator. Private to the core. */
#ifndef PVID_SOLVE_STATE_F32_H
#define PVID_SOLVE_STATE_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/estimator.h"

static inline bool pvid_is_positive_f32(const pvid_model_f32 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

/* Returns whether a step takes sum C^T N e of its rows beside the sums: gamma < 1. */
static inline bool pvid_feeds_back_f32(const pvid_estimator_f32 *self)
{
    return (PVID_FEEDBACK != 0) && (self->settings.gain < 1.0f);
}

/* Returns whether init has accepted a configuration. */
static inline bool pvid_estimator_is_ready_f32(const pvid_estimator_f32 *self)
{
    const bool ready = (self != NULL) && (self->model != NULL);
    PVID_ASSERT(ready);
    return ready;
}

/* Sums of zero, as behind init: p stays, until the caller places it. */
void pvid_estimator_clear_f32(pvid_estimator_f32 *self);

#endif
