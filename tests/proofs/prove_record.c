/* record: any bytes of any length read, for any number of parameters; any row written at any place of it. */
#include "prove.h"

#include "persist/record.h"

static uint8_t bytes[PVID_RECORD_BYTES(PVID_MAX_P)];

void main(void)
{
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)any_u32(0, 255);
    }
    const uint32_t mechanism = any_u32(0, UINT32_MAX);
    pvid_record_row row;
    for (uint8_t n_p = 1; n_p <= PVID_MAX_P; n_p++) {
        if (pvid_record_inspect(bytes, any_u32(0, sizeof bytes), n_p, mechanism) == PVID_RECORD_DONE) {
            for (uint8_t a = 0; a < n_p; a++) {
                pvid_record_get(bytes, n_p, a, &row);
            }
        }
        for (uint8_t i = 0; i < PVID_MAX_P; i++) {
            row.value = any_u32(0, UINT32_MAX);
            row.error = any_u32(0, UINT32_MAX);
            row.correlation[i] = (int16_t)any_i32(INT16_MIN, INT16_MAX);
        }
        for (uint8_t a = 0; a < n_p; a++) {
            pvid_record_writer writer = {any_u32(0, UINT32_MAX), any_u32(0, UINT32_MAX), (uint8_t)any_u32(0, 255)};
            (void)pvid_record_next(&writer, n_p, any_u32(0, UINT32_MAX), any_bool(), any_u32(0, sizeof bytes));
            //@ check writer.next < n_p;
            writer.next = a;
            (void)pvid_record_put(&writer, n_p, mechanism, &row, bytes);
        }
    }
}
