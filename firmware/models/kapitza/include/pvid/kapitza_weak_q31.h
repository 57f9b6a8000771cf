/* pvid/kapitza_weak_q31.h - Kapitza's pendulum in the weak form for the fixed-point estimator: kapitza_weak.h with
 * integers only. */
#ifndef PVID_KAPITZA_WEAK_Q31_H
#define PVID_KAPITZA_WEAK_Q31_H

#include "pvid/kapitza_parameters.h"
#include "pvid/model_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Unknown offset: 8 entries of theta, p = (w, d1, d2, c). */
extern const pvid_model_q31 pvid_kapitza_weak_q31;

/* No offset: 5 entries of theta, p = (w, d1, d2). */
extern const pvid_model_q31 pvid_kapitza_weak_zeroed_q31;

#ifdef __cplusplus
}
#endif

#endif
