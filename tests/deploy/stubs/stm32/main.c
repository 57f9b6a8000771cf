/* Stands in for the main.c of STM32CubeMX: the three calls of the package in their places, a timer that is polled. */
#include "dc_motor_app.h"
#include "port.h"

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
