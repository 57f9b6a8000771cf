/* Sensors that read what another board, or a simulation, has recorded: the table of stream_recording.h, once, or with
 * STREAM_REPEATS over and over. */
#include "sensor.h"

#include "pvid/little_endian.h"
#include "stream_recording.h"

static uint32_t next;

void sensor_start(void)
{
    next = 0;
}

bool sensor_read(uint8_t sample[SAMPLE_BYTES])
{
    if (next == RECORDED_TICKS) {
#ifdef STREAM_REPEATS
        next = 0;
#else
        return false;
#endif
    }
    for (uint32_t i = 0; i < STREAM_SAMPLES; i++) {
        STREAM_PUT(&sample[4u * i], recorded[next][i]);
    }
    next++;
    return true;
}
