/* pvid/counter.h - counts of an encoder whose counter starts over: of 8 to 32 bits, or at any other modulus. */
#ifndef PVID_COUNTER_H
#define PVID_COUNTER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Counts from reading `before` to reading `now` [counts], -modulus/2 .. modulus/2: the encoder must move by less
 * between the two. modulus: 256 of 8 bits, 65536 of 16 bits, 4000 of an encoder that is reset at each turn; 0: 2^32. A
 * reading that is not below the modulus counts as its remainder. A motion of exactly half of 2^32 gives 0. */
int32_t pvid_counter_difference(uint32_t before, uint32_t now, uint32_t modulus);

#ifdef __cplusplus
}
#endif

#endif
