/* pvid.h - identifies the parameters of a mechanism on the microcontroller that drives it.
 *
 * C99, float32, static memory, no library but sqrtf. Start at weak.h or strong.h (samples in,
 * parameters out) or at estimator.h and model.h (rows of a model of yours in). */
#ifndef PVID_PVID_H
#define PVID_PVID_H

#include "pvid/arithmetic.h"
#include "pvid/crc32.h"
#include "pvid/differentiator.h"
#include "pvid/differentiator_q31.h"
#include "pvid/estimator.h"
#include "pvid/estimator_q31.h"
#include "pvid/fnv.h"
#include "pvid/fnv_q31.h"
#include "pvid/gate.h"
#include "pvid/gate_q31.h"
#include "pvid/information.h"
#include "pvid/kapitza.h"
#include "pvid/kapitza_q31.h"
#include "pvid/kapitza_strong_q31.h"
#include "pvid/kapitza_weak.h"
#include "pvid/kapitza_weak_q31.h"
#include "pvid/little_endian.h"
#include "pvid/misfit.h"
#include "pvid/misfit_q31.h"
#include "pvid/model.h"
#include "pvid/model_q31.h"
#include "pvid/publication.h"
#include "pvid/publication_q31.h"
#include "pvid/snapshot.h"
#include "pvid/status.h"
#include "pvid/strong.h"
#include "pvid/strong_q31.h"
#include "pvid/trust.h"
#include "pvid/weak.h"
#include "pvid/weak_q31.h"

#define PVID_VERSION_MAJOR 0
#define PVID_VERSION_MINOR 1
#define PVID_VERSION_PATCH 0

#endif
