/* What the normal equations and the residual of the strong form promise its solve and its assessment. */
#ifndef KAPITZA_CONTRACTS_H
#define KAPITZA_CONTRACTS_H

#include "kapitza_sums_q31.h"

/*@ assigns *system \from *self;
    ensures \initialized(system->s + (0 .. 5)) && \initialized(system->f + (0 .. 2));
    ensures \subset(system->s[0 .. 5], (-0x100000000 .. 0x100000000));
    ensures \subset(system->f[0 .. 2], (-0x2000000000000000 .. 0x2000000000000000));
    ensures \initialized(&system->time) && 0 <= system->time <= 8;
    ensures \initialized(&system->scale_a) && \initialized(&system->scale_x) && \initialized(&system->scale_z);
    ensures -400 <= system->scale_a <= 400 && -400 <= system->scale_x <= 400 && -400 <= system->scale_z <= 400;
    ensures \initialized(&system->of_x) && \initialized(&system->of_z);
    ensures -400 <= system->of_x <= 400 && -400 <= system->of_z <= 400; */
void pvid_kapitza_project_q31(const pvid_kapitza_estimator_q31 *self, pvid_kapitza_system_q31 *system);

/*@ assigns of[0 .. 2] \from *self, *system;
    ensures \initialized(of + (0 .. 2));
    ensures \subset(of[0 .. 2], (-400 .. 400)); */
void pvid_kapitza_exponents_q31(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                                int32_t of[PVID_KAPITZA_P]);

/*@ assigns \result \from *self;
    ensures 0 <= \result <= 0x4000000000000000; */
int64_t pvid_kapitza_residual_q31(const pvid_kapitza_estimator_q31 *self);

#endif
