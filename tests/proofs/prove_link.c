/* The decoder of the frame codec: any number of any bytes. (The encoder: prove_encoder.c.) */
#include "prove.h"

#include "link.h"

static pvid_link_decoder decoder;

static uint32_t whole_frame(const pvid_link_frame *frame)
{
    uint32_t sum = frame->tick + frame->type + frame->sequence;
    for (size_t i = 0; i < frame->length; i++) {
        sum += frame->payload[i];
    }
    return sum;
}

static void one_byte(void)
{
    pvid_link_frame frame;
    if (pvid_link_decode(&decoder, (uint8_t)any_u32(0, 255), &frame)) {
        (void)whole_frame(&frame);
    }
}

/* The hint is PVID_LINK_RAW_BYTES(PVID_LINK_MAX_PAYLOAD), where a frame that goes on is too long. */
void main(void)
{
    pvid_link_decoder_init(&decoder);
    /*@ loop widen_hints decoder.filled, 15, 16, 2063, 2064; */
    while (any_bool()) {
        one_byte();
    }
}
