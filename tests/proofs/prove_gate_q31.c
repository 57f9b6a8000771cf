/* gate_q31: any configuration, any floor; any residual on top of any scale that the gate keeps. */
#include "prove.h"

#include "contracts.h"
#include "pvid/gate_q31.h"

#define LOWEST (-2000) /* exponent of a floor */
#define HIGHEST 71     /* and of the largest scale */

static pvid_scaled_q31 any_positive(int32_t lowest, int32_t highest)
{
    const pvid_scaled_q31 x = {any_i32(PVID_ONE_Q30 / 2, PVID_ONE_Q30), any_i32(lowest, highest)};
    return x;
}

/* A gate that has judged so many; a count of none or all there can be is known to be below or above any memory. */
static void any_residual(uint32_t least, uint32_t most)
{
    pvid_gate_q31 gate;
    const pvid_gate_config_q31 config = {any_u32(0, UINT32_MAX), any_u32(0, UINT32_MAX)};
    if (pvid_gate_init_q31(&gate, &config, any_u32(0, UINT32_MAX), any_positive(LOWEST, HIGHEST)) != PVID_OK) {
        return;
    }
    gate.scale.m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    gate.scale.e = any_i32(LOWEST - 1, HIGHEST + 1);
    gate.judged = any_u32(least, most);
    gate.part.m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    gate.part.e = any_i32(-200, 200);
    gate.usual.m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    gate.usual.e = any_i32(LOWEST - 1, HIGHEST + 1);
    const pvid_scaled_q31 square = {any_i32(0, PVID_ONE_Q30), any_i32(-2000, 200)};
    (void)(any_bool() ? pvid_gate_passes_q31(&gate, square) : (pvid_gate_judge_q31(&gate, square) != 0));
    /*@ assert -0x40000000 <= gate.scale.m <= 0x40000000; */
    /*@ assert LOWEST - 1 <= gate.scale.e <= HIGHEST + 1; */
    /*@ assert -0x40000000 <= gate.usual.m <= 0x40000000; */
    /*@ assert LOWEST - 1 <= gate.usual.e <= HIGHEST + 1; */
    /*@ assert -0x40000000 <= gate.part.m <= 0x40000000; */
    /*@ assert -200 <= gate.part.e <= 200; */
}

void main(void)
{
    any_residual(0, 0);
    any_residual(1, UINT32_MAX - 1u);
    any_residual(UINT32_MAX, UINT32_MAX);
}
