/* pvid/detail/gate_verdict.h - what gate.h and gate_q31.h return for a residual. */
#ifndef PVID_DETAIL_GATE_VERDICT_H
#define PVID_DETAIL_GATE_VERDICT_H

typedef enum {
    PVID_GATE_REJECTS,
    PVID_GATE_ACCEPTS,
    PVID_GATE_OPENS /* accepts what was an outlier before */
} pvid_gate_verdict;

#endif
