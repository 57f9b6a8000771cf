/* pvid/fnv.h - running hash of the estimator's state: equal hashes on two computers mean equal bits at every tick.
 *
 * FNV-1a, 32 bits, over the little-endian bytes of p, of every sum (M, B, yy, weight) and of the reason code, in
 * this order, after every tick.
 */
#ifndef PVID_FNV_H
#define PVID_FNV_H

#include <stdint.h>

#include "pvid/estimator.h"
#include "pvid/fnv_word.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Continues hash over the estimator's state after a tick with this reason. */
uint32_t pvid_fnv_estimator_f32(uint32_t hash, const pvid_estimator_f32 *estimator, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
