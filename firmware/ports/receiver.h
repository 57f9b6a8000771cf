/* ports/receiver.h - what arrives at the serial port, kept by an interrupt until the program has time for it.
 *
 * A UART holds one byte to sixteen; a tick in soft float takes as long as dozens arrive. With the receiver none is lost
 * as long as no more than PVID_RECEIVER_BYTES - 1 arrive between two calls of take; where the other end waits (an
 * emulator's does), none is lost at all. An image that uses it links pvid_receiver (firmware/cmake/PvidBoard.cmake).
 */
#ifndef PVID_RECEIVER_H
#define PVID_RECEIVER_H

#include <stddef.h>
#include <stdint.h>

/* A power of two. */
#define PVID_RECEIVER_BYTES 256u

/* After pvid_port_init: from here on pvid_port_receive is not to be called. */
void pvid_receiver_init(void);

/* As pvid_port_receive. */
size_t pvid_receiver_take(uint8_t bytes[], size_t room);

/* Sleeps until a byte arrives, or not at all if one is there. */
void pvid_receiver_rest(void);

#endif
