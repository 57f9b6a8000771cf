/* pvid/record_weak.h - the record of record.h for the weak form. */
#ifndef PVID_RECORD_WEAK_H
#define PVID_RECORD_WEAK_H

#include "pvid/record.h"
#include "pvid/weak.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes the next piece, a parameter, of the record of the published estimate; begins again where another one was
 * published meanwhile. mechanism: any number that names parameters and units, as the hash in a package's header.
 * Returns PVID_RECORD_MORE before the last piece. May be called from any context, also while another one calls step.
 * Cost of a piece: a copy of the estimate, a checksum of at most 34 bytes and n_p - 1 quotients; less than the longest
 * tick. A motor of seven parameters: 1040 instructions on a Cortex-M4F. */
pvid_record_status pvid_record_save_weak_f32(const pvid_weak_f32 *self, pvid_record_writer *writer, uint32_t mechanism,
                                             uint8_t record[], size_t room);

/* Initialises `self` again with config and the record's values as the start; start_sd stays config's: a smaller one
 * delays the first estimate, and would hold p where the mechanism has changed. Until that estimate, the published one
 * is the record's, with its standard errors, number 0 and no standing. Bytes behind the record are ignored. Any answer
 * but PVID_RECORD_DONE leaves `self` unchanged, but for PVID_RECORD_NOT_READY by a config that init refuses: `self`
 * must be initialised again. Call it from the context of step; no other context reads meanwhile, as during init. Cost:
 * that of init. */
pvid_record_status pvid_record_load_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                             uint32_t mechanism, const uint8_t record[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
