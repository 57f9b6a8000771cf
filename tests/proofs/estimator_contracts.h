/* What the estimator, the gate and the verdict promise to who calls them, as contracts. */
#ifndef ESTIMATOR_CONTRACTS_H
#define ESTIMATOR_CONTRACTS_H

#include "solve/row_q31.h"
#include "solve/state_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/trust_q31.h"

/*@ requires \valid(e) && \valid_read(block) && \valid_read(n + (0 .. block->n - 1));
    assigns *e, \result \from \nothing;
    ensures \result == 0 || \result == 1;
    ensures \initialized(e) && -0x200000000000 <= *e <= 0x200000000000; */
bool pvid_estimator_innovation_q31(const pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[],
                                   int32_t y, int64_t *e);

/*@ requires \valid(self) && \valid_read(n + (0 .. self->model->n_theta - 1));
    assigns \result \from \nothing;
    ensures \result == PVID_ACCUMULATED || \result == PVID_REJECTED_SATURATED; */
pvid_reason pvid_estimator_add_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t y);

/*@ requires \valid(self) && 0 <= variance.m <= 0x40000000 && -10000 <= variance.e <= 10000;
    assigns \nothing; */
void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance);

/*@ requires \valid(self) && part < PVID_INFORMATION_END_PARTS && factor >= 1;
    assigns \nothing; */
void pvid_information_fade_q31(pvid_information_q31 *self, size_t part, int32_t factor);

/*@ requires \valid(self);
    assigns \result \from \nothing;
    ensures 0 <= \result; */
int32_t pvid_trust_fade_factor_q31(pvid_trust_q31 *self);

/*@ requires \valid(self) && \valid(solve);
    assigns solve->group_rss \from \nothing;
    ensures 0 <= solve->group_rss <= 0x4000000000000000; */
void pvid_estimator_begin_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, bool ends_group);

/*@ requires \valid(self) && \valid(solve);
    assigns \result, solve->reason, solve->size \from \nothing;
    ensures \result == 0 || \result == 1;
    ensures 0 <= solve->size && PVID_ACCUMULATED <= solve->reason <= PVID_HELD_PIVOT; */
bool pvid_estimator_advance_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve);

/*@ requires \valid_read(self) && \valid(solve) && \valid(estimate);
    assigns solve->above_noise \from \nothing;
    ensures solve->above_noise == 0 || solve->above_noise == 1; */
void pvid_estimator_begin_assessment_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                         pvid_estimate_q31 *estimate);

/*@ requires \valid_read(self) && \valid(solve) && \valid(estimate);
    assigns \result, solve->above_noise \from \nothing;
    ensures \result == 0 || \result == 1;
    ensures solve->above_noise == 0 || solve->above_noise == 1; */
bool pvid_estimator_assess_advance_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                       pvid_estimate_q31 *estimate);

/*@ requires \valid(self) && square.m >= 0;
    assigns \result \from \nothing;
    ensures \result == 0 || \result == 1; */
bool pvid_gate_passes_q31(pvid_gate_q31 *self, pvid_scaled_q31 square);

/*@ requires \valid_read(self);
    assigns \result \from self;
    ensures \result == \null || \result == &self->estimate.p[0]; */
const int32_t *pvid_trust_fallback_q31(const pvid_trust_q31 *self);

/*@ requires \valid(self) && \valid(estimator) && \valid_read(candidate);
    requires size >= 0 && variance_ratio >= 0;
    assigns \result \from \nothing;
    ensures PVID_WARMING_UP <= \result <= PVID_REJECTED_SATURATED; */
pvid_reason pvid_trust_judge_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason reason, int64_t size,
                                 bool above_noise, int64_t variance_ratio, const pvid_estimate_q31 *candidate);

#endif
