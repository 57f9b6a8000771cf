/* The row of the strong form, inlined where samples become rows: derivatives that it does not use are not computed
 * then. Private to the core. */
#ifndef PVID_KAPITZA_ROW_F32_H
#define PVID_KAPITZA_ROW_F32_H

#include "pvid/kapitza.h"

/* Places in N and theta; the powers of u descend there, as in the paper. */
enum { PVID_N_A = 0, PVID_N_E = 1, PVID_N_PHI2 = 2, PVID_N_PHI0 = 6 };

/* As pvid_kapitza_strong_row_f32. */
static inline void pvid_kapitza_row_f32(const float phi[5], const float u[3], float *y,
                                        float n[PVID_KAPITZA_STRONG_THETA])
{
    const float u0 = u[0];
    const float u1 = u[1];
    const float u2 = u[2];
    const float two_u0 = 2.0f * u0;
    const float two_u1 = 2.0f * u1;
    *y = (((u0 * u0) * phi[4]) - ((two_u0 * u1) * phi[3])) + (((two_u1 * u1) - (u0 * u2)) * phi[2]);
    n[PVID_N_A] = ((two_u1 * phi[3]) - (two_u0 * phi[4])) + (u2 * phi[2]);
    n[PVID_N_E] = -phi[4];
    n[5] = -phi[2];
    n[4] = u0 * n[5];
    n[3] = u0 * n[4];
    n[2] = u0 * n[3];
    n[10] = -phi[0];
    n[9] = u0 * n[10];
    n[8] = u0 * n[9];
    n[7] = u0 * n[8];
    n[6] = u0 * n[7];
}

#endif
