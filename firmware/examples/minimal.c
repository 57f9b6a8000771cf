/* The least program: identifies a recorded motion of a motor and prints its parameters. */
#include <stdio.h>

#include "dc_motor_example.h"

int main(void)
{
    float sample[DC_MOTOR_SAMPLES];
    const pvid_status status = dc_motor_begin();
    if (status != PVID_OK) {
        printf("%s\n", pvid_status_text(status));
        return 1;
    }
    for (uint32_t tick = 0; dc_motor_example_sample(tick, sample); tick++) { /* your rig: sensors, once a period */
        const pvid_reason reason = dc_motor_step(sample);
        if ((reason != PVID_ACCUMULATED) && (reason != PVID_WARMING_UP)) {
            printf("tick %u: %s\n", (unsigned)tick, pvid_reason_text(reason));
        }
    }
    float value[DC_MOTOR_PARAMETERS];
    float error[DC_MOTOR_PARAMETERS];
    if (dc_motor_read(value, error) == 0u) {
        return 1;
    }
    for (int k = 0; k < DC_MOTOR_PARAMETERS; k++) {
        printf("%s = %g +- %g %s\n", dc_motor_parameter[k], (double)value[k], (double)error[k], dc_motor_unit[k]);
    }
    return 0;
}
