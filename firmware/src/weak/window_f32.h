/* A window of the weak form while it fills: double integrals and sums. Private to the core. */
#ifndef PVID_WEAK_WINDOW_F32_H
#define PVID_WEAK_WINDOW_F32_H

#include <stddef.h>

#include "pvid/weak.h"

/* Places among the sums of a function. Each sum is over the window's samples, of a factor from the table chi times a
 * product of signals; I2 is a double integral. The first eight are also the places of a sample's terms, which are these
 * products; the others use the same products with another factor. finish_f32.c combines the sums to Y and N of (10) and
 * (11) in theory.md. */
enum {
    PVID_TERM_UF = 0,     /* chi'' (-u phi) */
    PVID_TERM_F = 1,      /* chi'' (-phi) */
    PVID_TERM_UIUF = 2,   /* chi'' (-u I2(u phi)) */
    PVID_TERM_UIF = 3,    /* chi'' (-u I2(phi)) */
    PVID_TERM_UIU = 4,    /* chi'' u I2(u) */
    PVID_TERM_UI1 = 5,    /* chi'' u I2(1) */
    PVID_TERM_U = 6,      /* chi'' u */
    PVID_TERM_UT = 7,     /* chi'' u t */
    PVID_TERM_CHI_UF = 8, /* chi (-u phi) */
    PVID_TERM_CHI_F = 9,  /* chi (-phi) */
    PVID_TERM_CHI_U = 10, /* chi u */
    PVID_TERM_CHI_1 = 11, /* chi */
    PVID_TERM_Y = 12      /* chi'''' phi */
};

/* Integrates up to the decimated sample phi [rad], u [1/s^2] at self->index and writes its terms; 0 for the window's
 * first sample, where chi is 0. I2 is the double integral from the window's first sample, by the trapezoid rule minus
 * dt^2/6 times the integrand; t is the time from the window's middle. Cost: 40 operations. */
void pvid_weak_window_terms_f32(pvid_weak_window_f32 *self, uint16_t samples, float dt, float phi, float u,
                                const pvid_weak_curvature_f32 *curvature, float term[PVID_WEAK_SAMPLE_TERMS]);

/* Variance of u [1/s^4]. This function and the next three are valid once the window is complete; `samples` is W. */
float pvid_weak_window_drive_f32(const pvid_weak_window_f32 *self, uint16_t samples);

/* Mean of phi [rad]. */
float pvid_weak_window_mean_f32(const pvid_weak_window_f32 *self, uint16_t samples);

/* Largest |phi - offset| [rad]. */
float pvid_weak_window_max_deviation_f32(const pvid_weak_window_f32 *self, float offset);

/* Mean square of the second differences of phi [rad^2]; 0 if there are none. */
float pvid_weak_window_curvature_f32(const pvid_weak_window_f32 *self);

/* Adds the terms of the last two samples to the sums of functions first..last-1, and clears these sums at the window's
 * first sample. term[0] are the terms of the sample with the even index, term[1] those of the odd index after it. Only
 * a call at an odd index adds: a sum is loaded and stored once for two samples. The last sample with chi != 0 has an
 * odd index. */
void pvid_weak_window_add_f32(const pvid_weak_window_f32 *self, const pvid_weak_design_f32 *design,
                              const float term[2][PVID_WEAK_SAMPLE_TERMS], size_t first, size_t last,
                              float sums[][PVID_WEAK_TERMS]);

#endif
