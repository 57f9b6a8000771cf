/* pvid/fnv_word.h - FNV-1a, 32 bits, a word at a time: what fnv.h and fnv_q31.h are made of. */
#ifndef PVID_FNV_WORD_H
#define PVID_FNV_WORD_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PVID_FNV_START 0x811C9DC5u

/* hash continued over one 32-bit word, low byte first, whatever the machine's byte order. */
uint32_t pvid_fnv_word(uint32_t hash, uint32_t word);

#ifdef __cplusplus
}
#endif

#endif
