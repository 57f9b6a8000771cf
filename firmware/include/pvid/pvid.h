/* pvid.h - identifies the parameters of a mechanism on the microcontroller that drives it.
 *
 * C99, float32, static memory, no library function but sqrtf. Start with weak.h (samples in, parameters out), or with
 * estimator.h and model.h for rows of your own model. Integers only: pvid_q31.h.
 */
#ifndef PVID_PVID_H
#define PVID_PVID_H

#include "pvid/arithmetic.h"
#include "pvid/commission.h"
#include "pvid/counter.h"
#include "pvid/crc32.h"
#include "pvid/differentiator.h"
#include "pvid/estimator.h"
#include "pvid/excite.h"
#include "pvid/fnv.h"
#include "pvid/fnv_refine.h"
#include "pvid/gate.h"
#include "pvid/information.h"
#include "pvid/little_endian.h"
#include "pvid/misfit.h"
#include "pvid/model.h"
#include "pvid/publication.h"
#include "pvid/refine.h"
#include "pvid/record_weak.h"
#include "pvid/snapshot_refine.h"
#include "pvid/snapshot_weak.h"
#include "pvid/status.h"
#include "pvid/text.h"
#include "pvid/trust.h"
#include "pvid/version.h"
#include "pvid/weak.h"

#endif
