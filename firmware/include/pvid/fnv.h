/* pvid/fnv.h - the running hash by which two computers agree that they computed the same bits.
 *
 * FNV-1a, 32 bits, over the little-endian bytes of p, of every sum (M, B, yy, weight) and of the
 * reason code, in this order, after every tick. Equal hashes: equal states at every tick.
 */
#ifndef PVID_FNV_H
#define PVID_FNV_H

#include <stdint.h>

#include "pvid/estimator.h"
#include "pvid/fnv_word.h"

#ifdef __cplusplus
extern "C" {
#endif

/* hash continued over the estimator's state after a tick that ended with `reason`. */
uint32_t pvid_fnv_estimator_f32(uint32_t hash, const pvid_estimator_f32 *estimator, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
