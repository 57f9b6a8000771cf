/* The design that the proofs of the weak form run on, and what its weights make of any samples within full scale. */
#ifndef PROOF_WEAK_DESIGN_H
#define PROOF_WEAK_DESIGN_H

#include "number/integer_q31.h"
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

/* What the sum of a term over a window stays within: prove_weak_window_q31.c shows it, prove_weak_finish_q31.c builds
 * on it. */
static const int32_t largest_sum[PVID_WEAK_TERMS_Q31] = {
    15000000,  12500000,  1400000000, 1200000000, 900000000, 900000000, 360000000,  300000000,
    130000000, 600000000, 1300000000, 1100000000, 130000000, 820000000, 1500000000,
};

#endif
