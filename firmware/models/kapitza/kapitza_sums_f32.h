/* The strong form's functions of model.h. Private to the core. */
#ifndef PVID_KAPITZA_SUMS_F32_H
#define PVID_KAPITZA_SUMS_F32_H

#include "pvid/kapitza.h"

#define PVID_KAPITZA_STRONG_MOMENTS 45

/* `accumulate` and `project`. */
void pvid_kapitza_accumulate_f32(const float n[], float y, const float high[], float low[], float sums[]);
float pvid_kapitza_project_f32(const float p[], const float m[], const float b[], float s[][PVID_MAX_P], float f[]);

/* `accumulate`, whatever the sums are then. */
void pvid_kapitza_add_f32(const float n[], float y, const float high[], float low[]);

/* Both in one, without the returned number, with the same bits: no sum is written out and read again. */
void pvid_kapitza_absorb_f32(const float p[restrict], const float n[restrict], float y, const float high[restrict],
                             float low[restrict], float s[restrict][PVID_MAX_P], float f[restrict]);

#endif
