/* Frames on their way to the PC, in a bounded queue that the main loop empties as the port takes bytes. */
#ifndef ANSWERS_H
#define ANSWERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ANSWERS_BYTES 2048u

typedef struct {
    uint16_t sequence;
    size_t first; /* bytes[first .. end - 1] have not left */
    size_t end;
    uint8_t bytes[ANSWERS_BYTES];
} answers;

/* Passes bytes to the port as it accepts them. */
void answers_pump(answers *self);

/* Whether n bytes fit. */
bool answers_fit(const answers *self, size_t n);

/* Queues a frame; one that does not fit is dropped, and its sequence number with it, so that the PC counts it. */
void answers_put(answers *self, uint8_t type, uint32_t tick, const uint8_t payload[], size_t length);

#endif
