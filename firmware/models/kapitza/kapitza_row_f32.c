#include "number/uncontracted.h"

#include "kapitza_row_f32.h"

void pvid_kapitza_strong_row_f32(const float phi[5], const float u[3], float *y, float n[PVID_KAPITZA_STRONG_THETA])
{
    pvid_strong_row_f32 row;
    pvid_kapitza_row_f32(phi, u, &row);
    *y = row.x[PVID_ROW_Y];
    n[0] = row.x[PVID_ROW_A];
    n[1] = row.x[PVID_ROW_E];
    n[5] = row.f2;
    n[4] = row.u * n[5];
    n[3] = row.u * n[4];
    n[2] = row.u * n[3];
    n[10] = row.f0;
    n[9] = row.u * n[10];
    n[8] = row.u * n[9];
    n[7] = row.u * n[8];
    n[6] = row.u * n[7];
}
