/* Hashes of tables that both cores of the weak form have in common, continued from `hash`. Private to the core. */
#ifndef PVID_FINGERPRINT_TABLES_H
#define PVID_FINGERPRINT_TABLES_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/weak_parts.h"

uint32_t pvid_fingerprint_bytes(uint32_t hash, const uint8_t values[], size_t n);

uint32_t pvid_fingerprint_signals(uint32_t hash, const pvid_weak_signal signal[], size_t n);
uint32_t pvid_fingerprint_jets(uint32_t hash, const pvid_weak_jet jet[], size_t n);
uint32_t pvid_fingerprint_channels(uint32_t hash, const pvid_weak_channel channel[], size_t n);
uint32_t pvid_fingerprint_kinds(uint32_t hash, const pvid_weak_kind kind[], size_t n);

#endif
