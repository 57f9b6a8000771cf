/* A buffer in two halves: one fills with samples while the main loop steps through the other, one call and no interrupt
 * a tick, and the same bits as tick by tick. float32 takes the units of the model: counts of a DMA are converted first,
 * half by half; fixed point takes them as they are. */
#include <stdio.h>

#include "dc_motor_example.h"

#define TICKS 24 /* of a half; a block may be of any length */

static float buffer[2][TICKS][DC_MOTOR_SAMPLES];
static volatile uint32_t filled; /* halves so far */
static uint32_t tick;

/* Half transfer and transfer complete: the other half fills. */
void dma_interrupt(void);
void dma_interrupt(void)
{
    filled = filled + 1u;
}

/* Sleeps until the next interrupt, __WFI on a Cortex-M; here the DMA itself. Returns the samples of the half. */
static uint32_t wait_for_half(uint32_t half)
{
    uint32_t count = 0u;
    while ((count < TICKS) && dc_motor_example_sample(tick, buffer[half % 2u][count])) { /* your rig: the converter */
        count++;
        tick++;
    }
    dma_interrupt();
    return count;
}

int main(void)
{
    uint32_t shown = 0u;
    uint32_t half = 0u; /* that is next */
    if (dc_motor_begin() != PVID_OK) {
        return 1;
    }
    for (uint32_t count = wait_for_half(half); count > 0u; count = wait_for_half(half)) {
        float value[DC_MOTOR_PARAMETERS];
        float error[DC_MOTOR_PARAMETERS];
        if ((filled - half) == 1u) {
            (void)dc_motor_step_block(buffer[half % 2u][0], count);
        }
        half++;
        if (filled != half) { /* too late: the half was filled again, or more are lost */
            half = filled;
            dc_motor_gap();
        }
        const uint32_t number = dc_motor_read(value, error);
        if (number != shown) {
            shown = number;
            printf("estimate %u behind tick %u: %s = %g\n", (unsigned)number, (unsigned)tick, dc_motor_parameter[0],
                   (double)value[0]);
        }
    }
    return (shown > 0u) ? 0 : 1;
}
