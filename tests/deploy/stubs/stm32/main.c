/* Stands in for the main.c of STM32CubeMX: the three calls of the package in their places, a timer that is polled. */
#include "dc_motor_app.h"
#include "port.h"
#include "stdio.h"

int puts(const char *text)
{
    for (; *text != '\0'; text++) {
        while (pvid_port_send((const uint8_t *)text, 1) == 0u) {
        }
    }
    while (pvid_port_send((const uint8_t *)"\n", 1) == 0u) {
    }
    return 0;
}

static void HAL_TIM_PeriodElapsedCallback(void)
{
    dc_motor_app_tick();
}

int main(void)
{
    pvid_port_init();
    if (dc_motor_app_start() != 0) {
        pvid_port_exit(1);
    }
    for (;;) {
        HAL_TIM_PeriodElapsedCallback();
        if (dc_motor_app_poll() != 0) {
            pvid_port_exit(0);
        }
    }
}
