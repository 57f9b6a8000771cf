/* FreeRTOS: a task steps at the rate of the rig, another one of lower priority reads. No mutex is needed. */
#include <stdio.h>

#include "FreeRTOS.h"
#include "dc_motor_example.h"
#include "task.h"

/* In ticks of the system: a whole number. Another one would scale every time of the model, and no residual shows it. */
#define TIMES_1E6 ((uint64_t)DC_MOTOR_PERIOD_US * (uint64_t)configTICK_RATE_HZ)
#define PERIOD ((TickType_t)(TIMES_1E6 / 1000000u))
typedef char raise_configTICK_RATE_HZ[(TIMES_1E6 > 0 && TIMES_1E6 % 1000000u == 0) ? 1 : -1];

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
