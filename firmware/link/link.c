#include "link.h"

#include <string.h>

#include "pvid/crc32.h"
#include "pvid/little_endian.h"

#define GROUP 0xFFu /* code of a COBS group of 254 bytes without a 0 at its end */

typedef struct {
    uint8_t *out;
    size_t at;
    size_t code_at; /* where the code of the present group goes */
    uint8_t code;   /* one more than the bytes in it */
} stuffer;

/* Each byte adds at most 255 to 254 at + code, which is why PVID_LINK_ENCODED_BYTES is room enough. */
/*@ requires \valid(self) && \valid_read(bytes + (0 .. n - 1)) && \valid(self->out + (0 .. room - 1));
    requires \separated(self, self->out + (0 .. room - 1), bytes + (0 .. n - 1));
    requires 1 <= self->code <= 255 && self->code_at < self->at;
    requires 254 * self->at + self->code + 255 * n <= 254 * room && room <= 65535;
    assigns self->at, self->code_at, self->code, self->out[0 .. room - 1];
    ensures 1 <= self->code <= 255 && self->code_at < self->at;
    ensures 254 * self->at + self->code <= 254 * \old(self->at) + \old(self->code) + 255 * n; */
static void stuff(stuffer *self, const uint8_t bytes[], size_t n) /*@ ghost (size_t room) */
{
    /*@ loop invariant 0 <= i <= n;
        loop invariant 1 <= self->code <= 255 && self->code_at < self->at;
        loop invariant 254 * self->at + self->code <= \at(254 * self->at + self->code, Pre) + 255 * i;
        loop assigns i, self->at, self->code_at, self->code, self->out[0 .. room - 1];
        loop variant n - i; */
    for (size_t i = 0; i < n; i++) {
        if (self->code == GROUP) { /* full: opened only now, because nothing may follow */
            self->code_at = self->at++;
            self->code = 1u;
        }
        if (bytes[i] != 0u) {
            self->out[self->at++] = bytes[i];
            self->code++;
            self->out[self->code_at] = self->code;
        } else {
            self->out[self->code_at] = self->code;
            self->code_at = self->at++;
            self->code = 1u;
        }
    }
    self->out[self->code_at] = self->code;
}

/*@ requires \valid_read(frame) && \valid_read(frame->payload + (0 .. frame->length - 1));
    requires \valid(out + (0 .. room - 1));
    requires \separated(frame, out + (0 .. room - 1));
    requires \separated(frame->payload + (0 .. frame->length - 1), out + (0 .. room - 1));
    assigns out[0 .. room - 1]; */
size_t pvid_link_encode(const pvid_link_frame *frame, uint8_t out[], size_t room)
{
    if ((frame->length > PVID_LINK_MAX_SENT) || (room < PVID_LINK_ENCODED_BYTES(frame->length))) {
        return 0;
    }
    uint8_t header[PVID_LINK_HEADER_BYTES];
    header[0] = PVID_LINK_VERSION;
    header[1] = frame->type;
    pvid_put_u32(&header[2], PVID_LINK_SCHEMA);
    pvid_put_u16(&header[6], frame->sequence);
    pvid_put_u32(&header[8], frame->tick);
    uint8_t crc[PVID_LINK_CRC_BYTES];
    const uint32_t of_header = pvid_crc32(0u, header, sizeof header);
    pvid_put_u32(crc, pvid_crc32(of_header, frame->payload, frame->length));

    stuffer state = {.out = out, .at = 1, .code_at = 0, .code = 1u};
    stuff(&state, header, sizeof header) /*@ ghost (PVID_LINK_ENCODED_BYTES(frame->length)) */;
    stuff(&state, frame->payload, frame->length) /*@ ghost (PVID_LINK_ENCODED_BYTES(frame->length)) */;
    stuff(&state, crc, sizeof crc) /*@ ghost (PVID_LINK_ENCODED_BYTES(frame->length)) */;
    out[state.at] = 0u;
    return state.at + 1u;
}

void pvid_link_decoder_init(pvid_link_decoder *self)
{
    memset(self, 0, sizeof *self);
}

static void count(uint32_t *counter, uint32_t n)
{
    *counter = (n > (UINT32_MAX - *counter)) ? UINT32_MAX : (*counter + n);
}

static void append(pvid_link_decoder *self, uint8_t byte)
{
    if (self->filled == sizeof self->raw) {
        self->bad = true;
    } else {
        self->raw[self->filled++] = byte;
    }
}

static void follow_sequence(pvid_link_decoder *self, uint16_t sequence)
{
    const uint16_t ahead = (uint16_t)(sequence - self->sequence);
    if (self->synchronised && (ahead < 0x8000u)) {
        count(&self->counters.missing, ahead);
    }
    self->synchronised = true;
    self->sequence = (uint16_t)(sequence + 1u);
}

/* Checks the bytes in raw after the final 0. */
static bool accept(pvid_link_decoder *self, pvid_link_frame *frame)
{
    if (self->bad || (self->left != 0u) || (self->filled < PVID_LINK_RAW_BYTES(0u))) {
        count(&self->counters.malformed, 1u);
        return false;
    }
    const size_t checked = self->filled - PVID_LINK_CRC_BYTES;
    if (pvid_crc32(0u, self->raw, checked) != pvid_get_u32(&self->raw[checked])) {
        count(&self->counters.bad_crc, 1u);
        return false;
    }
    bool known = (self->raw[0] == PVID_LINK_VERSION) && (pvid_get_u32(&self->raw[2]) == PVID_LINK_SCHEMA);
#if PVID_MAX_P > 8 /* frames without parameters are the same in both */
    known = known || ((self->raw[0] == PVID_LINK_VERSION) && (pvid_get_u32(&self->raw[2]) == PVID_LINK_NARROW_SCHEMA));
#endif
    if (!known) {
        count(&self->counters.foreign, 1u);
        return false;
    }
    frame->type = self->raw[1];
    frame->sequence = pvid_get_u16(&self->raw[6]);
    frame->tick = pvid_get_u32(&self->raw[8]);
    frame->payload = &self->raw[PVID_LINK_HEADER_BYTES];
    frame->length = checked - PVID_LINK_HEADER_BYTES;
    count(&self->counters.frames, 1u);
    follow_sequence(self, frame->sequence);
    return true;
}

bool pvid_link_decode(pvid_link_decoder *self, uint8_t byte, pvid_link_frame *frame)
{
    if (byte == 0u) {
        const bool good = self->started && accept(self, frame);
        self->filled = 0;
        self->left = 0;
        self->bad = false;
        self->started = false;
        self->zero_due = false;
        return good;
    }
    self->started = true;
    if (self->bad) {
        return false;
    }
    if (self->left == 0u) {
        if (self->zero_due) {
            append(self, 0u);
        }
        self->left = (uint8_t)(byte - 1u);
        self->zero_due = (byte != GROUP);
    } else {
        append(self, byte);
        self->left--;
    }
    return false;
}
