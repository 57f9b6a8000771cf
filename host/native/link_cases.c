/* Declared in native.h. Host only. */
#include <string.h>

#include "link.h"
#include "native.h"
#include "pvid/little_endian.h"

#define FRAME_HEAD 9u /* type u8, sequence u16, tick u32, length u16 */

uint32_t pvid_native_link_encode(uint8_t type, uint16_t sequence, uint32_t tick, const uint8_t payload[],
                                 uint32_t length, uint8_t out[], uint32_t room)
{
    const pvid_link_frame frame = {type, sequence, tick, payload, length};
    return (uint32_t)pvid_link_encode(&frame, out, room);
}

uint32_t pvid_native_link_decode(const uint8_t bytes[], uint32_t n, uint8_t out[], uint32_t counters[5])
{
    static pvid_link_decoder decoder;
    pvid_link_frame frame;
    size_t at = 0;
    pvid_link_decoder_init(&decoder);
    for (uint32_t i = 0; i < n; i++) {
        if (pvid_link_decode(&decoder, bytes[i], &frame)) {
            out[at] = frame.type;
            pvid_put_u16(&out[at + 1u], frame.sequence);
            pvid_put_u32(&out[at + 3u], frame.tick);
            pvid_put_u16(&out[at + 7u], (uint16_t)frame.length);
            memcpy(&out[at + FRAME_HEAD], frame.payload, frame.length);
            at += FRAME_HEAD + frame.length;
        }
    }
    counters[0] = decoder.counters.frames;
    counters[1] = decoder.counters.missing;
    counters[2] = decoder.counters.malformed;
    counters[3] = decoder.counters.bad_crc;
    counters[4] = decoder.counters.foreign;
    return (uint32_t)at;
}
