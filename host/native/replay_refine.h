/* What Python calls of the refinement. */
#ifndef PVID_REPLAY_REFINE_H
#define PVID_REPLAY_REFINE_H

#include <stdint.h>

#include "pvid/weak.h"
#include "pvid/refine.h"
#include "pvid/snapshot_refine.h"

/* Steps an initialised refinement through samples[ticks][n_samples]. weak_p, weak_se [ticks][PVID_REFINE_P]: estimates
 * of the weak form that are new at a tick, NaN at all others. Results, each NULL or [ticks]: the reason; the running
 * hash (pvid/fnv_refine.h); r and standard errors [parameters] as published, 0 where there is none. */
void pvid_replay_refine_f32(pvid_refine_f32 *self, uint32_t ticks, uint32_t n_samples, const float samples[],
                            const float weak_p[], const float weak_se[], uint32_t *running_hash, uint8_t reason[],
                            uint32_t hash[], float r[], float se[]);

/* Steps an identifier with a refinement through samples[ticks][samples of its model]. Results, each NULL or [ticks]:
 * the reason of the weak form; what the refinement's last block told, and whether the weak form was busy (both or
 * none); the weak form's estimates p, se [PVID_REFINE_P] at the ticks at which they are new, NaN at all others; r and
 * standard errors as above; the running hash of both stages. */
void pvid_replay_both_stages_f32(pvid_weak_f32 *self, uint32_t ticks, const float samples[], uint8_t reason[],
                                 uint8_t told[], uint8_t busy[], float weak_p[], float weak_se[], float r[], float se[],
                                 uint32_t *running_hash, uint32_t hash[]);

/* Numbers of the model and of this build: order, coordinates, inputs, outputs, moving, parameters, skew, p. */
void pvid_replay_refine_shape(uint32_t shape[8]);

#endif
