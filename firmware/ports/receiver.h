/* ports/receiver.h - buffers received bytes in an interrupt until the program reads them.
 *
 * A UART buffers 1 to 16 bytes; dozens arrive during a tick in soft float. With the receiver none is lost if at
 * most PVID_RECEIVER_BYTES - 1 arrive between two calls of take; with flow control (emulators) none is ever lost.
 * An image that uses it links pvid_receiver (firmware/cmake/PvidBoard.cmake).
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
