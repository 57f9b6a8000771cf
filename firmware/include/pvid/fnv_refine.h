/* pvid/fnv_refine.h - running hash of a refinement: equal hashes on two computers mean equal bits at every tick.
 *
 * FNV-1a, 32 bits, over the point of linearisation, the state of the pass, the level and the reason code, in this
 * order, after every tick. Of a number that is not finite it covers that fact alone.
 */
#ifndef PVID_FNV_REFINE_H
#define PVID_FNV_REFINE_H

#include <stdint.h>

#include "pvid/fnv_word.h"
#include "pvid/refine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Continues hash over the refinement's state after a tick with this reason. */
uint32_t pvid_fnv_refine_f32(uint32_t hash, const pvid_refine_f32 *refinement, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
