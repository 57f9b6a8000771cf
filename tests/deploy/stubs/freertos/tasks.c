/* Stands in for FreeRTOS: tasks are threads, one tick a microsecond or more; ends when all tasks have. */
#include <pthread.h>
#include <unistd.h>

#include "task.h"

#define MOST 4

static struct {
    void (*run)(void *);
    pthread_t thread;
} tasks[MOST];
static int count;

static void *started(void *place)
{
    tasks[*(int *)place].run(NULL);
    return NULL;
}

int xTaskCreate(void (*task)(void *), const char *name, unsigned words, void *argument, unsigned priority,
                void **handle)
{
    (void)name;
    (void)words;
    (void)argument;
    (void)priority;
    (void)handle;
    tasks[count++].run = task;
    return 1;
}

void vTaskStartScheduler(void)
{
    int place[MOST];
    for (int k = 0; k < count; k++) {
        place[k] = k;
        pthread_create(&tasks[k].thread, NULL, started, &place[k]);
    }
    for (int k = 0; k < count; k++) {
        pthread_join(tasks[k].thread, NULL);
    }
}

void vTaskDelay(TickType_t ticks)
{
    usleep(ticks);
}

void vTaskDelayUntil(TickType_t *wake, TickType_t period)
{
    *wake += period;
    usleep(period);
}

TickType_t xTaskGetTickCount(void)
{
    return 0;
}

void vTaskDelete(void *task)
{
    (void)task;
}
