/* What records of both cores have in common: pvid/record.h. Private to the core. */
#ifndef PVID_PERSIST_RECORD_H
#define PVID_PERSIST_RECORD_H

#include <stdbool.h>

#include "pvid/config.h"
#include "pvid/record.h"

/* A parameter: bits of two binary32, and the correlations with those behind it, Q15. */
typedef struct {
    uint32_t value;
    uint32_t error;
    int16_t correlation[PVID_MAX_P];
} pvid_record_row;

/* Before a piece: PVID_RECORD_MORE, or why there is none. writer->next is the parameter to write. */
pvid_record_status pvid_record_next(pvid_record_writer *writer, uint8_t n_p, uint32_t number, bool valid, size_t room);

/* Writes this parameter, the head before the first, the checksum behind the last. */
pvid_record_status pvid_record_put(pvid_record_writer *writer, uint8_t n_p, uint32_t mechanism,
                                   const pvid_record_row *row, uint8_t record[]);

/* Whether record[] holds an undamaged record of n_p parameters of this mechanism: PVID_RECORD_DONE, or why not. */
pvid_record_status pvid_record_inspect(const uint8_t record[], size_t length, uint8_t n_p, uint32_t mechanism);

/* Parameter a of a record that was inspected; all correlations, that with itself is 0. */
void pvid_record_get(const uint8_t record[], uint8_t n_p, uint8_t a, pvid_record_row *row);

#endif
