/* pvid/fnv_word.h - FNV-1a, 32 bits, one word at a time; used by fnv.h and fnv_q31.h. */
#ifndef PVID_FNV_WORD_H
#define PVID_FNV_WORD_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PVID_FNV_START 0x811C9DC5u

/* Continues hash over one 32-bit word, low byte first on every machine. */
uint32_t pvid_fnv_word(uint32_t hash, uint32_t word);

#ifdef __cplusplus
}
#endif

#endif
