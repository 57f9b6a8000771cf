#include "persist/record.h"

#include "pvid/crc32.h"
#include "pvid/little_endian.h"

#define MAGIC 0x43525650u /* "PVRC" */
#define FORMAT 1u
#define HEAD 12u
#define CRC_BYTES 4u

/* Where parameter a is. */
static size_t place_of(uint8_t n_p, uint8_t a)
{
    return HEAD + (8u * (size_t)a) + ((size_t)a * ((2u * (size_t)n_p) - 1u - a));
}

pvid_record_status pvid_record_next(pvid_record_writer *writer, uint8_t n_p, uint32_t number, bool valid, size_t room)
{
    if ((writer->number != number) || !valid || (writer->next >= n_p)) {
        writer->next = 0;
    }
    writer->number = number;
    if (!valid || (number == 0u)) {
        return PVID_RECORD_NOT_VALID;
    }
    return (room < PVID_RECORD_BYTES((size_t)n_p)) ? PVID_RECORD_NO_ROOM : PVID_RECORD_MORE;
}

pvid_record_status pvid_record_put(pvid_record_writer *writer, uint8_t n_p, uint32_t mechanism,
                                   const pvid_record_row *row, uint8_t record[])
{
    const uint8_t a = writer->next;
    if (a == 0u) {
        pvid_put_u32(record, MAGIC);
        record[4] = FORMAT;
        record[5] = n_p;
        pvid_put_u16(&record[6], (uint16_t)PVID_RECORD_BYTES((size_t)n_p));
        pvid_put_u32(&record[8], mechanism);
        writer->crc = pvid_crc32(0u, record, HEAD);
    }
    const size_t place = place_of(n_p, a);
    size_t end = place + 8u;
    pvid_put_u32(&record[place], row->value);
    pvid_put_u32(&record[place + 4u], row->error);
    for (size_t b = (size_t)a + 1u; b < n_p; b++) {
        pvid_put_u16(&record[end], (uint16_t)row->correlation[b]);
        end += 2u;
    }
    writer->crc = pvid_crc32(writer->crc, &record[place], end - place);
    writer->next = (uint8_t)(a + 1u);
    if (writer->next < n_p) {
        return PVID_RECORD_MORE;
    }
    pvid_put_u32(&record[end], writer->crc);
    return PVID_RECORD_DONE;
}

pvid_record_status pvid_record_inspect(const uint8_t record[], size_t length, uint8_t n_p, uint32_t mechanism)
{
    if ((length < 4u) || (pvid_get_u32(record) != MAGIC)) {
        return PVID_RECORD_NONE;
    }
    const size_t stated = (length < (HEAD + CRC_BYTES)) ? SIZE_MAX : pvid_get_u16(&record[6]);
    if (stated > length) {
        return PVID_RECORD_CUT_SHORT;
    }
    if ((stated < (HEAD + CRC_BYTES)) ||
        (pvid_crc32(0u, record, stated - CRC_BYTES) != pvid_get_u32(&record[stated - CRC_BYTES]))) {
        return PVID_RECORD_DAMAGED;
    }
    if (record[4] != FORMAT) {
        return PVID_RECORD_OTHER_FORMAT;
    }
    if ((record[5] != n_p) || (pvid_get_u32(&record[8]) != mechanism)) {
        return PVID_RECORD_OTHER_MECHANISM;
    }
    return (stated == PVID_RECORD_BYTES((size_t)n_p)) ? PVID_RECORD_DONE : PVID_RECORD_DAMAGED;
}

/* 16 bits in two's complement. */
static int16_t signed_of(uint16_t word)
{
    return (int16_t)((word < 0x8000u) ? (int32_t)word : ((int32_t)word - 0x10000));
}

void pvid_record_get(const uint8_t record[], uint8_t n_p, uint8_t a, pvid_record_row *row)
{
    const size_t place = place_of(n_p, a);
    row->value = pvid_get_u32(&record[place]);
    row->error = pvid_get_u32(&record[place + 4u]);
    row->correlation[a] = 0;
    for (uint8_t b = 0; b < n_p; b++) {
        if (b < a) {
            row->correlation[b] = signed_of(pvid_get_u16(&record[place_of(n_p, b) + 8u + (2u * ((size_t)a - b - 1u))]));
        } else if (b > a) {
            row->correlation[b] = signed_of(pvid_get_u16(&record[place + 8u + (2u * ((size_t)b - a - 1u))]));
        } else {
            /* with itself */
        }
    }
}
