/* What Python calls in the library of a compiled model in fixed point: the weak form of pvid/weak_q31.h. */
#ifndef PVID_REPLAY_WEAK_Q31_H
#define PVID_REPLAY_WEAK_Q31_H

#include <stdint.h>

#include "pvid/weak_q31.h"
#include "pvid/snapshot_weak_q31.h"
#include "replay_q31.h"

/* Steps an initialised identifier through readings[ticks][samples]. */
void pvid_replay_weak_q31(pvid_weak_q31 *self, uint32_t ticks, const int32_t readings[], const pvid_record_q31 *record);

#endif
