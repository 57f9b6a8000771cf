/* pvid/record.h - the identified parameters in about 100 bytes, for the next life of a machine.
 *
 * A snapshot (snapshot_slots.h) is the whole state: another release or one changed setting makes it useless. A record
 * contains the published values, their standard errors and the correlations of these, and no setting. A program of any
 * release and any settings that identifies the same parameters takes the values as its start: the sums begin at zero.
 *
 *   static uint8_t record[PVID_RECORD_BYTES(7)];                        7 parameters: 114 bytes
 *   (from time to time, in any context:)
 *   static pvid_record_writer writer;
 *   do {
 *       status = pvid_record_save_weak_f32(&identifier, &writer, mechanism, record, sizeof record);
 *   } while (status == PVID_RECORD_MORE);                               or one call a tick
 *   if (status == PVID_RECORD_DONE) write the bytes to flash            two areas in turn: power may fail
 *   (in the next life, behind init:)
 *   status = pvid_record_load_weak_f32(&identifier, &config, mechanism, flash, sizeof record);
 *
 * Save writes what was published and is valid now (standing.h), else nothing. Load changes nothing unless it returns
 * PVID_RECORD_DONE or init refuses its config. The checksum detects accidents, not attacks.
 *
 * Layout, all numbers little-endian:
 *    0 magic "PVRC"   4 format, 1   5 n_p   6 length [bytes], 16 bits   8 mechanism
 *   12 of each parameter a in order: value, standard error (IEEE-754 binary32, unit of the model), correlations with
 *      the parameters behind it (16 bits, two's complement, 2^-15)
 *   and last CRC-32 of all before it
 */
#ifndef PVID_RECORD_H
#define PVID_RECORD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    PVID_RECORD_DONE = 0,        /* written, or taken as the start */
    PVID_RECORD_MORE,            /* a piece is written: call it again */
    PVID_RECORD_NOT_VALID,       /* nothing to save: no published estimate is valid now */
    PVID_RECORD_NO_ROOM,         /* the bytes are too few for it */
    PVID_RECORD_NONE,            /* no record begins here */
    PVID_RECORD_CUT_SHORT,       /* fewer bytes than it states */
    PVID_RECORD_DAMAGED,         /* the checksum is wrong */
    PVID_RECORD_OTHER_FORMAT,    /* of a release with another layout */
    PVID_RECORD_OTHER_MECHANISM, /* other parameters, or other units */
    PVID_RECORD_IMPLAUSIBLE,     /* a value outside of the configuration's bounds, or no standard error */
    PVID_RECORD_NOT_READY        /* the identifier was not initialised with config, or a pointer is NULL */
} pvid_record_status;

/* Length of a record [bytes]. */
#define PVID_RECORD_BYTES(n_p) (16u + (8u * (n_p)) + ((n_p) * ((n_p) - 1u)))

/* How far a record is written. All zeros before the first call and after each init, load or restore; the same bytes
 * until PVID_RECORD_DONE. */
typedef struct {
    uint32_t number; /* of the estimate */
    uint32_t crc;    /* of the bytes so far */
    uint8_t next;    /* parameter */
} pvid_record_writer;

#ifdef __cplusplus
}
#endif

#endif
