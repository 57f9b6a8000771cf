/* Stands in for ESP-IDF: a periodic timer that runs while the main task waits. */
#include "esp_timer.h"
#include "freertos/task.h"

static void (*callback)(void *);
static uint64_t period;

void app_main(void);

int esp_timer_create(const esp_timer_create_args_t *arguments, esp_timer_handle_t *timer)
{
    callback = arguments->callback;
    *timer = 0;
    return 0;
}

int esp_timer_start_periodic(esp_timer_handle_t timer, uint64_t us)
{
    (void)timer;
    period = us;
    return 0;
}

int esp_timer_stop(esp_timer_handle_t timer)
{
    (void)timer;
    period = 0;
    return 0;
}

void vTaskDelay(uint32_t ticks)
{
    for (uint64_t us = 0; period > 0 && us < 1000u * ticks; us += period) {
        callback(0);
    }
}

int main(void)
{
    app_main();
    return 0;
}
