/* Everything that Python calls. The build preprocesses this file to pvid.i, from which pvid.core.headers reads the
 * structs, enumerations and functions: Python holds no second copy of them. */
#ifndef PVID_NATIVE_H
#define PVID_NATIVE_H

#include "pvid/crc32.h"
#include "replay.h"
#include "replay_q31.h"
#include "replay_refine.h"

/* The link's C side for the tests of pvid.link: bytes in, frames and counters out, flat.
 *
 * out [2 n]: each good frame as its head and payload, one after the other; returns the bytes used. */
uint32_t pvid_native_link_encode(uint8_t type, uint16_t sequence, uint32_t tick, const uint8_t payload[],
                                 uint32_t length, uint8_t out[], uint32_t room);
uint32_t pvid_native_link_decode(const uint8_t bytes[], uint32_t n, uint8_t out[], uint32_t counters[5]);

#endif
