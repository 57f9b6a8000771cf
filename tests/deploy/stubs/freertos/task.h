/* Stands in for FreeRTOS: see tasks.c. */
#ifndef TASK_H
#define TASK_H

#include "FreeRTOS.h"

#ifdef __cplusplus
extern "C" {
#endif

int xTaskCreate(void (*task)(void *), const char *name, unsigned words, void *argument, unsigned priority,
                void **handle);
void vTaskStartScheduler(void);
void vTaskDelay(TickType_t ticks);
void vTaskDelayUntil(TickType_t *wake, TickType_t period);
TickType_t xTaskGetTickCount(void);
void vTaskDelete(void *task);

#ifdef __cplusplus
}
#endif

#endif
