/* pvid/weak_parts.h - parts of a compiled model that both cores of the weak form share: weak.h, weak_q31.h.
 *
 * Integers only.
 */
#ifndef PVID_WEAK_PARTS_H
#define PVID_WEAK_PARTS_H

#include <stdint.h>

/* Where a signal comes from. */
enum {
    PVID_SIGNAL_SAMPLED = 0, /* the sample */
    PVID_SIGNAL_HELD,        /* of an input that is held from tick to tick: its mean about the tick */
    PVID_SIGNAL_JUMP,        /* dt/12 times the sample's difference to the one before, dt the tick */
    PVID_SIGNAL_LAST         /* the sample before */
};

typedef struct {
    uint8_t sample; /* index in the argument of step */
    uint8_t source; /* PVID_SIGNAL_ */
} pvid_weak_signal;

/* A signal or one of its derivatives. */
typedef struct {
    uint8_t signal;
    uint8_t order;
} pvid_weak_jet;

#define PVID_WEAK_NONE 255u

/* A channel: gain I^fold[integrand], I the integral from the window's start. At least one channel is summed. */
typedef struct {
    uint8_t gain;      /* index among the gains; PVID_WEAK_NONE: 1 with fold 0, whose sums are known: it costs
                          nothing as the last channel. A gain of 1 with an integral is an ordinary gain */
    uint8_t integrand; /* index among the integrands; PVID_WEAK_NONE: 1, so that I^fold is t^fold / fold! */
    uint8_t fold;      /* 0: no integral; 1, 2 */
    uint8_t plain;     /* of an integral: the channel with the same gain and fold 0 */
    uint8_t ramp;      /* of fold 2: the channel with the same gain and I^1[1] = t */
} pvid_weak_channel;

typedef struct {
    uint8_t thetas;
    uint8_t nuisances; /* columns that are projected out: unknown starts of integrals */
    uint16_t first;    /* its first term; terms are sorted by kind, then by column */
    uint16_t end;      /* behind its last term */
} pvid_weak_kind;

#endif
