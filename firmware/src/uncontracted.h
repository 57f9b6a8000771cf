/* No a * b + c of this file becomes one fused instruction, whatever the compiler's options say: gcc's default standard
 * (gnu17, gnu11 in many IDEs) would fuse them on every processor that can, and the bits would not be those promised.
 * To be included before everything else. Not for clang with -ffp-contract=fast, which does not obey;
 * pvid_arithmetic_faults_f32 finds that. */
#ifndef PVID_UNCONTRACTED_H
#define PVID_UNCONTRACTED_H

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif

#endif
