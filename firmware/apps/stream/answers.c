#include "answers.h"

#include "link.h"
#include "port.h"

void answers_pump(answers *self)
{
    self->first += pvid_port_send(&self->bytes[self->first], self->end - self->first);
    if (self->first == self->end) {
        self->first = 0;
        self->end = 0;
    }
}

bool answers_fit(const answers *self, size_t n)
{
    return (ANSWERS_BYTES - (self->end - self->first)) >= n;
}

static void close_up(answers *self)
{
    for (size_t i = self->first; i < self->end; i++) {
        self->bytes[i - self->first] = self->bytes[i];
    }
    self->end -= self->first;
    self->first = 0;
}

void answers_put(answers *self, uint8_t type, uint32_t tick, const uint8_t payload[], size_t length)
{
    const pvid_link_frame frame = {type, self->sequence, tick, payload, length};
    if ((ANSWERS_BYTES - self->end) < PVID_LINK_ENCODED_BYTES(length)) {
        close_up(self);
    }
    self->end += pvid_link_encode(&frame, &self->bytes[self->end], ANSWERS_BYTES - self->end);
    self->sequence++;
}
