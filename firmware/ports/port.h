/* ports/port.h - services of a board for an application: bytes in and out, a counter, an exit, the stack.
 *
 * One implementation per board, in C99 without vendor code; the core is independent of it. The applications of
 * firmware/apps use only these functions.
 *
 *   pvid_port_init();
 *   for (;;) {
 *       n = pvid_port_receive(bytes, sizeof bytes);   (0: nothing has arrived)
 *       ...
 *       sent += pvid_port_send(&answer[sent], left);  (0: no room yet, try again)
 *   }
 *
 * No function waits. Not reentrant: call them from the main loop, not from interrupts.
 */
#ifndef PVID_PORT_H
#define PVID_PORT_H

#include <stddef.h>
#include <stdint.h>

/* Prepares the serial port (115200 baud, 8N1 where the board has a baud rate) and the counter. Call it
 * once, first. The start-up code has already copied .data, cleared .bss, painted the stack and enabled
 * the FPU where there is one. */
void pvid_port_init(void);

/* Takes the bytes that have arrived, at most `room`; returns how many: 0 when none has. */
size_t pvid_port_receive(uint8_t bytes[], size_t room);

/* Passes at most `n` bytes to the serial port; returns how many it accepted, 0 while it is busy. They are sent in
 * order; nothing is overwritten. */
size_t pvid_port_send(const uint8_t bytes[], size_t n);

/* A free-running count for measurements. The difference of two calls, modulo 2^32, divided by
 * pvid_port_counts_per_1024() / 1024 is the number of executed instructions or cycles between them:
 *
 *   board                 counts                                       wraps after
 *   Cortex-M in QEMU      SysTick under -icount shift=8: instructions  2.6 million (netduinoplus2: 390 000,
 *                         (a core on silicon: its clock cycles)        microbit: 4 million)
 *   RISC-V virt           minstret under -icount shift=0: instructions 4 thousand million
 *   AVR in simavr         timer 1: clock cycles                        4 thousand million
 *
 * The call itself costs about 10 instructions, some of which are in the difference: measure two calls in a row and
 * subtract. */
uint32_t pvid_port_instructions(void);

/* Counts for 1024 instructions (AVR: cycles). */
uint32_t pvid_port_counts_per_1024(void);

/* Time since some moment [us], modulo 2^32. Call it at least every 90 ms (a 24-bit counter at 168 MHz), else time is
 * lost. Under -icount it is the emulator's time. */
uint32_t pvid_port_microseconds(void);

/* Ends the program: an emulator exits with `code` (0..255), a board stops. Does not return. Bytes that
 * were taken by pvid_port_send have left. */
#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void pvid_port_exit(int code);

/* Largest number of stack bytes in use since the start, by the paint that is overwritten; 0 if the board has no
 * painted stack (the host). Cost: one pass over the unused part. */
size_t pvid_port_stack_used(void);

/* Bytes of stack there are. */
size_t pvid_port_stack_size(void);

#endif
