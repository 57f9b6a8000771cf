/* pvid/fnv_q31.h - the running hash of fnv.h over the fixed-point estimator's state. */
#ifndef PVID_FNV_Q31_H
#define PVID_FNV_Q31_H

#include "pvid/estimator_q31.h"
#include "pvid/fnv_word.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Continues hash over p (int32), every sum (int64, low word first), the sums' exponent and the reason code (one
 * word each) after a tick with this reason. */
uint32_t pvid_fnv_estimator_q31(uint32_t hash, const pvid_estimator_q31 *estimator, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#endif
