#ifndef ZEPHYR_KERNEL_H
#define ZEPHYR_KERNEL_H
#include <stddef.h>
#include <stdint.h>
typedef struct {
    int64_t us;
} k_timeout_t;
struct k_timer {
    int64_t period;
    uint32_t expired;
};
#define K_USEC(us) ((k_timeout_t){us})
#define K_TIMER_DEFINE(name, expiry, stop) struct k_timer name = {0, 0}
void k_timer_start(struct k_timer *timer, k_timeout_t first, k_timeout_t period);
uint32_t k_timer_status_sync(struct k_timer *timer);
void k_timer_stop(struct k_timer *timer);
#endif
