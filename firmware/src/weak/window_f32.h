/* A window of the weak form while it fills: double integrals and sums. Private to the core. */
#ifndef PVID_WEAK_WINDOW_F32_H
#define PVID_WEAK_WINDOW_F32_H

#include <stddef.h>

#include "pvid/weak.h"

/* What the samples add, by the factor of the table: places among the sums of a function. The first eight are also
 * the places of a sample's terms; the others repeat these with another factor. */
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

/* Integrates up to the decimated sample phi [rad], u [1/s^2] at self->index and writes its terms, 0 for the window's
 * first sample, which has no weight.
 * I2 is the double integral from the window's first sample, by the trapezoid rule less dt^2/6 times
 * the integrand; t is the time from the window's middle. Cost: 40 operations. */
void pvid_weak_window_terms_f32(pvid_weak_window_f32 *self, uint16_t samples, float dt, float phi, float u,
                                const pvid_weak_curvature_f32 *curvature, float term[PVID_WEAK_SAMPLE_TERMS]);

/* Variance of u [1/s^4] over the samples so far; call it where the window is complete, as the next two. */
float pvid_weak_window_drive_f32(const pvid_weak_window_f32 *self, uint16_t samples);

/* Mean of phi [rad]. */
float pvid_weak_window_mean_f32(const pvid_weak_window_f32 *self, uint16_t samples);

/* Largest |phi - zero| [rad]. */
float pvid_weak_window_max_deviation_f32(const pvid_weak_window_f32 *self, float zero);

/* Mean square of the second differences of phi [rad^2]; 0 where there were none. */
float pvid_weak_window_curvature_f32(const pvid_weak_window_f32 *self);

/* Adds the terms of the last two samples to the sums of functions first..last-1; clears these at the window's first
 * sample. term[0] is that of an even index in the window, term[1] that of the odd one after it: only odd ones add, so
 * that a sum is loaded and stored once for two samples. The last sample with a weight is odd. */
void pvid_weak_window_add_f32(const pvid_weak_window_f32 *self, const pvid_weak_design_f32 *design,
                              const float term[2][PVID_WEAK_SAMPLE_TERMS], size_t first, size_t last,
                              float sums[][PVID_WEAK_TERMS]);

#endif
