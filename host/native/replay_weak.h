/* What Python calls in the library of a compiled model: the weak form of pvid/weak.h. */
#ifndef PVID_REPLAY_WEAK_H
#define PVID_REPLAY_WEAK_H

#include <stdint.h>

#include "pvid/weak.h"
#include "pvid/snapshot_weak.h"
#include "replay.h"

/* Steps an initialised identifier through samples[ticks][samples]. */
void pvid_replay_weak_f32(pvid_weak_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record);

/* Calls a function of a model on many inputs: in[n][inputs], out[n][outputs]. */
void pvid_replay_function_f32(void (*function)(const float in[], float out[]), uint32_t n, uint32_t inputs,
                              uint32_t outputs, const float in[], float out[]);

#endif
