/* kapitza_q31: any estimate whose standard errors and correlations are such, in any scale. */
#include "prove.h"

#include "contracts.h"
#include "pvid/kapitza_q31.h"

void main(void)
{
    pvid_estimate_q31 estimate;
    pvid_kapitza_scale_q31 scale;
    Frama_C_make_unknown((char *)&scale, sizeof scale);
    for (size_t a = 0; a < PVID_MAX_P; a++) {
        estimate.p[a] = any_i32(-INT32_MAX, INT32_MAX);
        estimate.se[a] = any_i32(0, INT32_MAX);
        for (size_t b = 0; b < PVID_MAX_P; b++) {
            estimate.correlation[a][b] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        }
    }
    pvid_kapitza_q31 value;
    pvid_kapitza_q31 se;
    if (pvid_kapitza_physical_q31(&estimate, &scale, &value, &se)) {
        /*@ assert 0 <= value.g && 0 <= value.l2 && 0 <= value.rho2; */
        /*@ assert 0 <= se.g && 0 <= se.l2 && 0 <= se.rho2; */
    }
}
