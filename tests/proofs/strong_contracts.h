/* What the parts of the strong form's identifier promise it. */
#ifndef STRONG_CONTRACTS_H
#define STRONG_CONTRACTS_H

#include "judge/misfit_q31.h"
#include "pvid/differentiator_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/kapitza_strong_q31.h"

/* Of what they read but a number is named: a number made of pointers would be none. */

/*@ requires -0x1000000 <= phi <= 0x1000000 && -0x1000000 <= y <= 0x1000000;
    assigns self->head, self->at, self->missing, self->history[0 .. PVID_MAX_WINDOW - 1][0 .. 1] \from phi, y;
    assigns \result, d_phi[0 .. 4], d_y[0 .. 2] \from phi, y;
    ensures \result == 0 || \result == 1;
    ensures \result != 0 ==> \initialized(d_phi + (0 .. 4)) && \initialized(d_y + (0 .. 2));
    ensures \result != 0 ==> \subset(d_phi[0 .. 4], (-0x40000000 .. 0x40000000));
    ensures \result != 0 ==> \subset(d_y[0 .. 2], (-0x40000000 .. 0x40000000)); */
bool pvid_differentiator_step_q31(pvid_differentiator_q31 *self, int32_t phi, int32_t y, int32_t d_phi[PVID_ORDERS],
                                  int32_t d_y[PVID_Y_ORDERS_Q31]);

/*@ requires 0 <= square.m <= 0x40000000 && -2000 <= square.e <= 200;
    requires -0x40000000 <= self->scale.m <= 0x40000000 && -2001 <= self->scale.e <= 72;
    assigns self->scale, self->judged, self->part \from *self, square;
    assigns \result \from *self, square;
    ensures \result == 0 || \result == 1;
    ensures -0x40000000 <= self->scale.m <= 0x40000000 && -2001 <= self->scale.e <= 72; */
bool pvid_gate_passes_q31(pvid_gate_q31 *self, pvid_scaled_q31 square);

/*@ assigns \result, *self \from bank->phi_max;
    ensures 0 <= \result <= 100;
    ensures \result != 0 ==> \result >= 1;
    ensures \result == 0 ==> \initialized(&self->bank.phi_max) && 1 <= self->bank.phi_max <= 0x1000000;
    ensures \result == 0 ==> \initialized(&self->bank.y_max) && 1 <= self->bank.y_max <= 0x1000000; */
pvid_status pvid_differentiator_init_layout_q31(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank,
                                                uint32_t layout);

/*@ assigns self->head, self->at, self->missing \from \nothing;
    assigns self->history[0 .. PVID_MAX_WINDOW - 1][0 .. 1] \from \nothing; */
void pvid_differentiator_reset_q31(pvid_differentiator_q31 *self);

/*@ requires \subset(phi[0 .. 4], (-0x40000000 .. 0x40000000)) && \subset(u[0 .. 2], (-0x40000000 .. 0x40000000));
    assigns \result, row[0 .. 12] \from *format, phi[0 .. 4], u[0 .. 2];
    ensures \result == 0 || \result == 1;
    ensures \result != 0 ==> \initialized(row + (0 .. 12)); */
bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *format, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t row[PVID_KAPITZA_ROW_Q31]);

/* The row is one that fits. */
/*@ requires \initialized(e) && *e == 0 && \initialized(gradient + (0 .. 2)) && \subset(gradient[0 .. 2], (0 .. 0));
    assigns \result, *e, gradient[0 .. 2] \from *self, row[0 .. 12];
    ensures \result == 0 || \result == 1;
    ensures \initialized(e) && \initialized(gradient + (0 .. 2));
    ensures -0x10000000 <= *e <= 0x0FFFFFFF;
    ensures \subset(gradient[0 .. 2], (-0x40000000 .. 0x3FFFFFFF)); */
bool pvid_kapitza_estimator_innovate_q31(const pvid_kapitza_estimator_q31 *self,
                                         const int32_t row[PVID_KAPITZA_ROW_Q31], int32_t *e,
                                         int32_t gradient[PVID_KAPITZA_P]);

/*@ assigns \result, *self \from config->row_sd, rows->reference;
    ensures 0 <= \result <= 100;
    ensures \result != 0 ==> \result >= 1;
    ensures \result == 0 ==> \initialized(&self->settings.row_sd) && 1 <= self->settings.row_sd;
    ensures self->ready == 0 || self->ready == 1; */
pvid_status pvid_kapitza_estimator_init_q31(pvid_kapitza_estimator_q31 *self, const pvid_estimator_config_q31 *config,
                                            const pvid_strong_row_q31 *rows);

/*@ requires -0x10000000 <= e <= 0x0FFFFFFF;
    assigns \result, *self \from row[0 .. 12], e, gradient[0 .. 2];
    ensures self->ready == 1; */
pvid_reason pvid_kapitza_estimator_take_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31],
                                            int32_t e, const int32_t gradient[PVID_KAPITZA_P]);

/*@ requires 1 <= drive_ticks <= 0x40000000;
    assigns *self \from drive_ticks, forgetting_groups; */
void pvid_misfit_init_q31(pvid_misfit_q31 *self, uint32_t drive_ticks, uint32_t forgetting_groups);

/*@ assigns \result \from sensitivity;
    ensures 0 <= \result <= 0x100000000000000; */
int64_t pvid_misfit_signal_q31(int64_t sensitivity);

/*@ requires 0 <= square <= 0x100000000000000;
    assigns \result, *self \from *self, square, signal;
    ensures \result == 0 || \result == 1; */
bool pvid_misfit_add_q31(pvid_misfit_q31 *self, int64_t square, int64_t signal);

/*@ assigns \result, *self \from *self;
    ensures \result == 0 || \result == 1; */
bool pvid_misfit_judge_q31(pvid_misfit_q31 *self);

#endif
