/* values_q31.c and sums_q31.c with the generated functions and the design of the pendulum (weak_design_q31.h, which
 * tools/prove.py makes): any jets within their reach from a restart on through a half; then sums of any blocks of such
 * channels, at all harmonics, and the window that is joined of them. Channels are within 2^28. */
#include <string.h>

#include "prove.h"

#include "weak/sums_q31.h"
#include "weak/values_q31.h"
#include "weak_design_q31.h"

#define DESIGN (&weak_design_q31)

static pvid_weak_values_q31 values;
static pvid_weak_sums_q31 sums;
static pvid_weak_window_q31 window;

/* The first entry of the blocks may then contain the channels of any step. */
static void any_step(void)
{
    pvid_weak_entry_q31 channel[PVID_MAX_CHANNELS][PVID_WEAK_BLOCK_Q31];
    int32_t jet[PVID_MAX_INPUTS];
    for (size_t i = 0; i < DESIGN->model->jets; i++) {
        jet[i] = any_i32(-weak_reach[i], weak_reach[i]);
    }
    const pvid_weak_outcome outcome = pvid_weak_values_step_q31(&values, DESIGN, jet, channel[0]);
    /*@ assert outcome != PVID_WEAK_BEYOND; */
    if (outcome == PVID_WEAK_CHANNELS) {
        for (size_t k = 0; k < pvid_weak_summed_q31(DESIGN->model); k++) {
            /*@ assert -0x10000000 <= channel[k][0] <= 0x10000000; */
            int32_t *place = &sums.block[0][k][0];
            *place = any_bool() ? channel[k][0] : *place;
        }
        pvid_weak_values_next_q31(&values, DESIGN->hop);
    }
}

static void any_half(uint8_t half)
{
    for (uint16_t last = PVID_WEAK_BLOCK_Q31 - 1; last < DESIGN->hop; last += PVID_WEAK_BLOCK_Q31) {
        pvid_weak_sums_next_q31(&sums, DESIGN, last, half);
        while (sums.left > 0u) {
            pvid_weak_sums_item_q31(&sums, DESIGN, &values, &window);
        }
    }
}

void main(void)
{
    pvid_weak_values_init_q31(&values, (uint16_t)any_u32(0, 1000));
    for (uint32_t step = 0; step < (uint32_t)DESIGN->hop + 4u; step++) {
        any_step();
    }
    for (size_t k = 0; k < PVID_MAX_CHANNELS; k++) {
        for (size_t j = 0; j < 2u * PVID_WEAK_BLOCK_Q31; j++) {
            sums.block[j / PVID_WEAK_BLOCK_Q31][k][j % PVID_WEAK_BLOCK_Q31] = sums.block[0][k][0];
        }
    }
    memcpy(values.edge[1], values.edge[0], sizeof values.edge[1]); /* the other half ends likewise */
    pvid_weak_sums_reset_q31(&sums);
    any_half(0);
    any_half(1);
    /*@ assert sums.halves == 2; */
}
