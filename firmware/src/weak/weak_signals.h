/* Signals and jets of a model: the same tables in float32 and in fixed point. */
#ifndef PVID_WEAK_SIGNALS_H
#define PVID_WEAK_SIGNALS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/weak_parts.h"

/* Samples that the signals need beside those of their tick: none, the last one, or the next one and two before. */
#define PVID_WEAK_NEEDS_NOTHING 0u
#define PVID_WEAK_NEEDS_LAST 1u
#define PVID_WEAK_NEEDS_NEXT 2u

static inline uint8_t pvid_weak_needs(const pvid_weak_signal signal[], size_t signals)
{
    uint8_t needs = PVID_WEAK_NEEDS_NOTHING;
    for (size_t i = 0; i < signals; i++) {
        const uint8_t source = signal[i].source;
        if (source == (uint8_t)PVID_SIGNAL_HELD) {
            needs = PVID_WEAK_NEEDS_NEXT;
        } else if ((source >= (uint8_t)PVID_SIGNAL_JUMP) && (needs == PVID_WEAK_NEEDS_NOTHING)) {
            needs = PVID_WEAK_NEEDS_LAST;
        } else {
            /* the sample itself */
        }
    }
    return needs;
}

/* The signals are the samples, in their order. */
static inline bool pvid_weak_signals_are_samples(const pvid_weak_signal signal[], size_t signals, size_t samples)
{
    bool plain = (signals == samples) && (pvid_weak_needs(signal, signals) == PVID_WEAK_NEEDS_NOTHING);
    for (size_t i = 0; i < signals; i++) {
        plain = plain && (signal[i].sample == i);
    }
    return plain;
}

/* Every signal is made of a sample in a way that there is, and every jet of a signal. */
static inline bool pvid_weak_signals_are_valid(const pvid_weak_signal signal[], size_t signals, size_t samples,
                                               const pvid_weak_jet jet[], size_t jets)
{
    bool valid = true;
    for (size_t i = 0; i < signals; i++) {
        valid = valid && (signal[i].sample < samples) && (signal[i].source <= (uint8_t)PVID_SIGNAL_LAST);
    }
    for (size_t i = 0; i < jets; i++) {
        valid = valid && (jet[i].signal < signals) && (jet[i].order <= PVID_MAX_POWER);
    }
    return valid;
}

#endif
