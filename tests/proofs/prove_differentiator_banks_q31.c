/* differentiator_q31: banks of any weights, centre, full scales and shifts that init takes, at every half and stride of
 * windows of up to WINDOW samples and at the ends of the longest; from init and from any place of the ring on, any
 * counts within full scale. */
#include "prove.h"

#include "number/integer_q31.h"
#include "pvid/differentiator_q31.h"

#define WINDOW 41u

static pvid_differentiator_q31 differentiator;
static int32_t weights[PVID_ORDERS * (PVID_MAX_WINDOW / 2)];

static uint8_t any_shift(void)
{
    return (uint8_t)any_u32(0, 62);
}

static void any_bank(uint16_t half, uint16_t stride)
{
    const pvid_fir_bank_q31 bank = {
        .half = half,
        .stride = stride,
        .phi_max = any_i32(1, PVID_COUNTS_LIMIT_Q31),
        .y_max = any_i32(1, PVID_COUNTS_LIMIT_Q31),
        .centre = any_i32(1, PVID_ONE_Q30),
        .phi_shift = {any_shift(), any_shift(), any_shift(), any_shift(), any_shift()},
        .y_shift = {any_shift(), any_shift(), any_shift()},
        .weights = weights,
    };
    if (pvid_differentiator_init_q31(&differentiator, &bank) != PVID_OK) {
        return;
    }
    int32_t phi[PVID_ORDERS];
    int32_t y[PVID_Y_ORDERS_Q31];
    const int32_t phi_max = differentiator.bank.phi_max;
    const int32_t y_max = differentiator.bank.y_max;
    (void)pvid_differentiator_step_q31(&differentiator, any_i32(-phi_max, phi_max), any_i32(-y_max, y_max), phi, y);
    const uint16_t length = differentiator.length;
    for (size_t i = 0; i < length; i++) {
        differentiator.history[i][0] = any_i32(-phi_max, phi_max);
        differentiator.history[i][1] = any_i32(-y_max, y_max);
    }
    differentiator.head = (uint16_t)any_u32(0, length - 1u);
    differentiator.missing = (uint16_t)any_u32(0, length);
    (void)pvid_differentiator_step_q31(&differentiator, any_i32(-phi_max, phi_max), any_i32(-y_max, y_max), phi, y);
    /*@ assert differentiator.head < length && differentiator.missing <= length; */
}

void main(void)
{
    for (size_t i = 0; i < sizeof weights / sizeof weights[0]; i++) {
        weights[i] = any_i32(-INT32_MAX, INT32_MAX);
    }
    for (uint16_t half = 2; half <= (WINDOW - 1u) / 2u; half++) {
        for (uint16_t stride = 1; (2u * half * stride) + 1u <= WINDOW; stride++) {
            any_bank(half, stride);
        }
    }
    any_bank((PVID_MAX_WINDOW - 1u) / 2u, 1);
    any_bank(2, (PVID_MAX_WINDOW - 1u) / 4u);
}
