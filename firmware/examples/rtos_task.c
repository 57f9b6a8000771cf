/* FreeRTOS: a task steps at the rate of the rig, another one of lower priority reads. No mutex is needed. */
#include <stdio.h>

#include "FreeRTOS.h"
#include "dc_motor_example.h"
#include "task.h"

/* Of a rig faster than the tick of the system one tick, which is too long: raise configTICK_RATE_HZ. */
#define PERIOD (pdMS_TO_TICKS(DC_MOTOR_PERIOD_US / 1000) > 0 ? pdMS_TO_TICKS(DC_MOTOR_PERIOD_US / 1000) : 1)

static void identify(void *unused)
{
    TickType_t wake = xTaskGetTickCount();
    float sample[DC_MOTOR_SAMPLES];
    (void)unused;
    for (uint32_t tick = 0; dc_motor_example_sample(tick, sample); tick++) { /* your rig: read the sensors here */
        (void)dc_motor_step(sample);
        vTaskDelayUntil(&wake, PERIOD);
    }
    vTaskDelete(NULL);
}

static void show(void *unused)
{
    float value[DC_MOTOR_PARAMETERS];
    float error[DC_MOTOR_PARAMETERS];
    (void)unused;
    while (dc_motor_read(value, error) == 0u) {
        vTaskDelay(pdMS_TO_TICKS(100));
    }
    printf("%s = %g +- %g %s\n", dc_motor_parameter[0], (double)value[0], (double)error[0], dc_motor_unit[0]);
    vTaskDelete(NULL);
}

int main(void)
{
    if (dc_motor_begin() != PVID_OK) {
        return 1;
    }
    (void)xTaskCreate(identify, "identify", 1024, NULL, 3, NULL); /* words of stack */
    (void)xTaskCreate(show, "show", 1024, NULL, 1, NULL);
    vTaskStartScheduler();
    return 0;
}
