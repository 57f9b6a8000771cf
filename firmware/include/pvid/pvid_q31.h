/* pvid_q31.h - identifies the parameters of a mechanism with integers only, for cores without a floating-point
 * unit.
 *
 * Includes no floating-point type. Start with weak_q31.h (sensor counts in, parameters out), or with estimator_q31.h
 * and model_q31.h for rows of your own model. In float32: pvid.h.
 */
#ifndef PVID_PVID_Q31_H
#define PVID_PVID_Q31_H

#include "pvid/bank_q31.h"
#include "pvid/counter.h"
#include "pvid/crc32.h"
#include "pvid/estimator_q31.h"
#include "pvid/fnv_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/misfit_q31.h"
#include "pvid/model_q31.h"
#include "pvid/publication_q31.h"
#include "pvid/record_weak_q31.h"
#include "pvid/snapshot_weak_q31.h"
#include "pvid/status.h"
#include "pvid/text.h"
#include "pvid/trust_q31.h"
#include "pvid/version.h"
#include "pvid/weak_q31.h"

#endif
