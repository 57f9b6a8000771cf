/* A window of the fixed-point weak form while it fills: double integrals and sums. Private to the core. */
#ifndef PVID_WEAK_WINDOW_Q31_H
#define PVID_WEAK_WINDOW_Q31_H

#include <stddef.h>

#include "pvid/weak_q31.h"

/* Places among the sums of a function, as in window_f32.h. Integrals in dt^2/12. */
enum {
    PVID_TERM_UIUF_HIGH_Q31 = 0, /* chi'' (-U I2(U F)): high part, without a shift */
    PVID_TERM_UIF_HIGH_Q31 = 1,  /* chi'' (-U I2(F)): high part */
    PVID_TERM_UF_Q31 = 2,        /* chi'' (-U F) */
    PVID_TERM_F_Q31 = 3,         /* chi'' (-F) */
    PVID_TERM_UIUF_Q31 = 4,      /* chi'' (-U I2(U F)): the rest */
    PVID_TERM_UIF_Q31 = 5,       /* chi'' (-U I2(F)): the rest */
    PVID_TERM_UIU_Q31 = 6,       /* chi'' U I2(U) */
    PVID_TERM_UI1_Q31 = 7,       /* chi'' U I2(1) */
    PVID_TERM_U_Q31 = 8,         /* chi'' U */
    PVID_TERM_UT_Q31 = 9,        /* chi'' U t */
    PVID_TERM_CHI_UF_Q31 = 10,   /* chi (-U F) */
    PVID_TERM_CHI_F_Q31 = 11,    /* chi (-F) */
    PVID_TERM_CHI_U_Q31 = 12,    /* chi U */
    PVID_TERM_CHI_1_Q31 = 13,    /* chi */
    PVID_TERM_Y_Q31 = 14         /* chi'''' F */
};

/* 1 as a term. */
#define PVID_TERM_ONE_Q31 ((int32_t)1 << 19)

/* Integrates up to the decimated sample F, U at self->index and writes the terms. */
void pvid_weak_window_terms_q31(pvid_weak_window_q31 *self, const pvid_weak_design_q31 *design, int32_t f, int32_t u,
                                const pvid_weak_curvature_q31 *curvature, int32_t term[PVID_WEAK_TERMS_Q31]);

/* (W - 1)^2 times the variance of U; valid once the window is complete. */
int64_t pvid_weak_window_drive_q31(const pvid_weak_window_q31 *self, uint16_t samples);

/* Mean square of the second differences of F; 0 if there are none. */
pvid_scaled_q31 pvid_weak_window_curvature_q31(const pvid_weak_window_q31 *self);

/* Adds the terms to the sums of functions first..last-1, or clears them at the window's first sample. */
void pvid_weak_window_add_q31(const pvid_weak_window_q31 *self, const pvid_weak_design_q31 *design,
                              const int32_t term[PVID_WEAK_TERMS_Q31], size_t first, size_t last,
                              int32_t sums[][PVID_WEAK_TERMS_Q31]);

#endif
