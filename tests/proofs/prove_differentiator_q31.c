/* differentiator_q31: the exact five-point bank at strides 1 to 3 with any counts within full scale, from an empty
 * window until the ring has come round three times. */
#include "prove.h"

#include "strong_contracts.h"

#define FULL_SCALE ((int32_t)1 << 22)

static pvid_differentiator_q31 differentiator;

static int32_t any_count(void)
{
    return any_i32(-FULL_SCALE, FULL_SCALE);
}

static void any_run(uint16_t stride)
{
    const pvid_fir_bank_q31 bank = {
        .half = 2,
        .stride = stride,
        .phi_max = FULL_SCALE,
        .y_max = FULL_SCALE,
        .centre = PVID_FIVE_POINTS_CENTRE_Q31,
        .weights = pvid_five_points_q31,
    };
    const pvid_status status = pvid_differentiator_init_q31(&differentiator, &bank);
    /*@ assert status == PVID_OK; */
    int32_t phi[PVID_ORDERS];
    int32_t y[PVID_Y_ORDERS_Q31];
    for (int turn = 0; turn < 40; turn++) {
        (void)pvid_differentiator_step_q31(&differentiator, any_count(), any_count(), phi, y);
    }
}

void main(void)
{
    any_run(1);
    any_run(2);
    any_run(3);
}
