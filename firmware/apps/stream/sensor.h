/* What the board samples in field mode. sensor_recording.c reads a recording; a board with
 * sensors has its own in their place. */
#ifndef SENSOR_H
#define SENSOR_H

#include <stdbool.h>
#include <stdint.h>

#include "identifier.h"

/* Starts over. */
void sensor_start(void);

/* The next samples, taken together, as the identifier gets them and as in a frame. Returns false if there are none: the
 * sensor has come to its end. */
bool sensor_read(uint8_t sample[SAMPLE_BYTES]);

#endif
