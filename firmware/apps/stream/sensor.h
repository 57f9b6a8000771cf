/* What the board samples in field mode. sensor.c simulates a rig; a board with an encoder has its own in its place. */
#ifndef SENSOR_H
#define SENSOR_H

#include <stdint.h>

/* Starts over. */
void sensor_start(void);

/* The next sample: counts of phi and y, taken together. */
void sensor_read(int32_t counts[2]);

#endif
