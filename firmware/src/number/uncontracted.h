/* Disables fused multiply-add (a * b + c in one instruction) for this file, independent of the compiler's options.
 * gcc's default standard (gnu17; gnu11 in many IDEs) enables it on every processor that has it, and the bits would
 * change. Include this header before all others. clang with -ffp-contract=fast ignores the pragma;
 * pvid_arithmetic_faults_f32 detects this. */
#ifndef PVID_UNCONTRACTED_H
#define PVID_UNCONTRACTED_H

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif

#endif
