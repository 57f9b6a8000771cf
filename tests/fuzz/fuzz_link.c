/* libFuzzer's target for the link: the decoder on any bytes, the encoder on any payload.
 *
 * Whatever arrives, a frame that is handed on must encode to bytes that decode to itself; and after whatever has
 * arrived, a 0 and an undamaged frame must come through.
 */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "link.h"

static void require(bool condition)
{
    if (!condition) {
        abort();
    }
}

static void require_same(const pvid_link_frame *one, const pvid_link_frame *other)
{
    require(one->type == other->type);
    require(one->sequence == other->sequence);
    require(one->tick == other->tick);
    require(one->length == other->length);
    require(memcmp(one->payload, other->payload, one->length) == 0);
}

/* Sends the frame through `decoder`, which stands at the start of one, and requires it to come out. */
static void require_through(pvid_link_decoder *decoder, const pvid_link_frame *frame)
{
    uint8_t bytes[PVID_LINK_ENCODED_BYTES(PVID_LINK_MAX_PAYLOAD)];
    const size_t n = pvid_link_encode(frame, bytes, sizeof bytes);
    require((n > 0u) && (bytes[n - 1u] == 0u));
    pvid_link_frame out;
    for (size_t i = 0; i + 1u < n; i++) {
        require(bytes[i] != 0u);
        require(!pvid_link_decode(decoder, bytes[i], &out));
    }
    require(pvid_link_decode(decoder, 0u, &out));
    require_same(frame, &out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static pvid_link_decoder decoder;
    static pvid_link_decoder second;
    pvid_link_frame frame;
    pvid_link_decoder_init(&decoder);
    for (size_t i = 0; i < size; i++) {
        if (pvid_link_decode(&decoder, data[i], &frame)) {
            require(frame.length <= PVID_LINK_MAX_PAYLOAD);
            pvid_link_decoder_init(&second);
            require_through(&second, &frame);
        }
    }
    const pvid_link_frame mine = {
        .type = (size > 0u) ? data[0] : 0u,
        .sequence = (uint16_t)size,
        .tick = (uint32_t)(size * 2654435761u),
        .payload = data,
        .length = (size < PVID_LINK_MAX_PAYLOAD) ? size : PVID_LINK_MAX_PAYLOAD,
    };
    (void)pvid_link_decode(&decoder, 0u, &frame);
    require_through(&decoder, &mine);
    return 0;
}
