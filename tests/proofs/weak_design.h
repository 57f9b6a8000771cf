/* The design that the proofs of the weak form run on, and what its weights make of any samples within full scale. */
#ifndef PROOF_WEAK_DESIGN_H
#define PROOF_WEAK_DESIGN_H

#include "integer_q31.h"
#include "weak_table_q31.h"

/* Largest |F|. */
static inline int64_t largest_f(const pvid_weak_design_q31 *design)
{
    int64_t total = 0;
    for (size_t i = 0; i < (design->taps - 1u) / 2u; i++) {
        total += (int64_t)pvid_magnitude_q31(design->smooth[i]);
    }
    return ((design->phi_max * (((int64_t)1 << design->smooth_bits) + (4 * total))) >> design->phi_shift) + 1;
}

#endif
