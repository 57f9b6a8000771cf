/* link/link.h - frames on a serial line: COBS(header || payload || CRC-32) || 0x00.
 *
 * The header is 12 bytes: version u8, type u8, schema u32, sequence u16, tick u32; schema.h describes the
 * payloads. All numbers are little-endian. The CRC (zlib's) covers header and payload. Only the last byte of a
 * frame is 0: a receiver resynchronises at the next 0.
 *
 *   n = pvid_link_encode(&frame, bytes, sizeof bytes);             (0: does not fit)
 *
 *   static pvid_link_decoder decoder;
 *   pvid_link_decoder_init(&decoder);
 *   each byte:  if (pvid_link_decode(&decoder, byte, &frame)) ... frame.payload is valid until the next byte
 *
 * Never allocates, never waits. Any bytes may be decoded: a frame is returned only if its structure, CRC, version
 * and schema are correct; others are counted and dropped. Neither function is reentrant on the same object. RAM:
 * sizeof(pvid_link_decoder), PVID_LINK_MAX_PAYLOAD + 48 bytes.
 */
#ifndef PVID_LINK_H
#define PVID_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "schema.h"

/* Longest payload of any frame [bytes]. */
#define PVID_LINK_MAX_SENT 2048u

/* Longest payload that a decoder takes [bytes]. RAM: as much in a decoder. The PC's side takes all. */
#ifndef PVID_LINK_MAX_PAYLOAD
#define PVID_LINK_MAX_PAYLOAD 2048
#endif
#if PVID_LINK_MAX_PAYLOAD < 256 || PVID_LINK_MAX_PAYLOAD > 2048
#error "PVID_LINK_MAX_PAYLOAD must lie in 256..2048"
#endif

#define PVID_LINK_HEADER_BYTES 12u
#define PVID_LINK_CRC_BYTES 4u

/* Bytes before COBS, and room that is enough for any encoded frame with n bytes of payload. */
#define PVID_LINK_RAW_BYTES(n) (PVID_LINK_HEADER_BYTES + (n) + PVID_LINK_CRC_BYTES)
#define PVID_LINK_ENCODED_BYTES(n) (PVID_LINK_RAW_BYTES(n) + (PVID_LINK_RAW_BYTES(n) / 254u) + 2u)

typedef struct {
    uint8_t type;           /* one of schema.h */
    uint16_t sequence;      /* one more than the frame before it, modulo 2^16 */
    uint32_t tick;          /* meaning depends on the type: number of a sample, or ticks done */
    const uint8_t *payload; /* [length] */
    size_t length;          /* 0..PVID_LINK_MAX_PAYLOAD */
} pvid_link_frame;

/* Counts of received frames and faults; each stops at 2^32 - 1. */
typedef struct {
    uint32_t frames;    /* good ones */
    uint32_t missing;   /* frames missing in the sequence */
    uint32_t malformed; /* no COBS, too short, too long */
    uint32_t bad_crc;
    uint32_t foreign; /* of another version or schema */
} pvid_link_counters;

/* Only the functions below write to it. */
typedef struct {
    pvid_link_counters counters;
    size_t filled;     /* bytes of raw */
    uint16_t sequence; /* expected next */
    bool synchronised; /* a frame was received: sequence is valid */
    bool bad;          /* this frame is too long: drop all up to the next 0 */
    bool started;      /* a byte was received since the last 0 */
    bool zero_due;     /* the COBS group that ended encodes a 0 if another group follows */
    uint8_t left;      /* bytes left in the COBS group */
    uint8_t raw[PVID_LINK_RAW_BYTES(PVID_LINK_MAX_PAYLOAD)];
} pvid_link_decoder;

/* Writes the encoded frame with its final 0 and returns its length. Fails (returns 0, writes nothing) iff
 *   - the payload is longer than PVID_LINK_MAX_SENT, or
 *   - room < PVID_LINK_ENCODED_BYTES(length). */
size_t pvid_link_encode(const pvid_link_frame *frame, uint8_t out[], size_t room);

/* An empty decoder that takes the first frame it meets as the start of the sequence. */
void pvid_link_decoder_init(pvid_link_decoder *self);

/* Decodes one byte. Returns true iff it completes a good frame, which is then in *frame. A sequence that jumps
 * back or by 2^15 or more means a restarted sender, not missing frames. Cost of the byte that ends a frame: a CRC
 * over the frame. */
bool pvid_link_decode(pvid_link_decoder *self, uint8_t byte, pvid_link_frame *frame);

#endif
