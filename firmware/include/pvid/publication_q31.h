/* pvid/publication_q31.h - publication.h for fixed-point estimates. */
#ifndef PVID_PUBLICATION_Q31_H
#define PVID_PUBLICATION_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator_q31.h"
#include "pvid/detail/publication_mark.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Only the functions below write to it. */
typedef struct {
    pvid_publication_mark mark;
    pvid_estimate_q31 estimate;
    pvid_estimate_q31 copy;
} pvid_publication_q31;

/* As pvid_publication_put_f32 and pvid_publication_read_f32. */
void pvid_publication_put_q31(pvid_publication_q31 *self, const pvid_estimate_q31 *estimate);
bool pvid_publication_read_q31(const pvid_publication_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number);

#ifdef __cplusplus
}
#endif

#endif
