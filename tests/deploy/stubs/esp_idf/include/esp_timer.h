#ifndef ESP_TIMER_H
#define ESP_TIMER_H
#include <stdint.h>
typedef struct esp_timer *esp_timer_handle_t;
typedef struct {
    void (*callback)(void *);
    void *arg;
    int dispatch_method;
    const char *name;
    _Bool skip_unhandled_events;
} esp_timer_create_args_t;
int esp_timer_create(const esp_timer_create_args_t *arguments, esp_timer_handle_t *timer);
int esp_timer_start_periodic(esp_timer_handle_t timer, uint64_t us);
int esp_timer_stop(esp_timer_handle_t timer);
#endif
