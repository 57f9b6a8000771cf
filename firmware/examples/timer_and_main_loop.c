/* A timer interrupt steps, the main loop reads. Neither waits for the other, and no interrupt is disabled: the read
 * copies the published estimate again if a step has just published another one. */
#include <stdio.h>

#include "dc_motor_example.h"

static volatile uint32_t tick;
static volatile bool ended;

/* Every DC_MOTOR_PERIOD_US, with a priority below that of the control loop: the longest step takes longer than the
 * mean. */
void timer_interrupt(void);
void timer_interrupt(void)
{
    float sample[DC_MOTOR_SAMPLES];
    if (dc_motor_example_sample(tick, sample)) { /* your rig: read the sensors here */
        (void)dc_motor_step(sample);
        tick = tick + 1u;
    } else {
        ended = true;
    }
}

/* Sleeps until the next interrupt, __WFI on a Cortex-M. Here the interrupt itself. */
static void wait_for_interrupt(void)
{
    timer_interrupt();
}

int main(void)
{
    uint32_t shown = 0u;
    if (dc_motor_begin() != PVID_OK) { /* before the interrupt is enabled */
        return 1;
    }
    while (!ended) {
        float value[DC_MOTOR_PARAMETERS];
        float error[DC_MOTOR_PARAMETERS];
        const uint32_t number = dc_motor_read(value, error);
        if (number != shown) {
            shown = number;
            printf("estimate %u at tick %u: %s = %g\n", (unsigned)number, (unsigned)tick, dc_motor_parameter[0],
                   (double)value[0]);
        }
        wait_for_interrupt();
    }
    return (shown > 0u) ? 0 : 1;
}
