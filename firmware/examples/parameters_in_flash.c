/* The identified values survive an update of the firmware, with other settings or another release of pvid: a record of
 * 114 bytes is the start of the next life. A real board writes it to two places in turn: power may fail during a write.
 */
#include <stdio.h>
#include <string.h>

#include "dc_motor_example.h"

static uint8_t flash[DC_MOTOR_RECORD]; /* your board: a place in its flash or EEPROM */

/* The whole record at once; in the context of a control loop call dc_motor_save once a tick instead. */
static void save(void)
{
    uint8_t record[DC_MOTOR_RECORD];
    pvid_record_status status;
    do {
        status = dc_motor_save(record);
    } while (status == PVID_RECORD_MORE);
    if (status == PVID_RECORD_DONE) { /* else nothing is valid now: the older record stays */
        memcpy(flash, record, sizeof flash);
    }
}

int main(void)
{
    float sample[DC_MOTOR_SAMPLES];
    dc_motor_estimate before;
    dc_motor_estimate after;
    memset(flash, 0xFF, sizeof flash);
    if ((dc_motor_begin() != PVID_OK) || (dc_motor_load(flash) != PVID_RECORD_NONE)) { /* the flash is empty */
        return 1;
    }
    for (int round = 0; round < 4; round++) { /* an estimate is valid when eight windows agree with it */
        for (uint32_t tick = 0; dc_motor_example_sample(tick, sample); tick++) {
            (void)dc_motor_step(sample);
        }
        dc_motor_gap();
    }
    save();
    (void)dc_motor_result(&before);
    if ((dc_motor_begin() != PVID_OK) || (dc_motor_load(flash) != PVID_RECORD_DONE) || !dc_motor_result(&after)) {
        return 1;
    }
    printf("%s = %g +- %g at the start of the next life\n", dc_motor_parameter[0], (double)after.value[0],
           (double)after.standard_error[0]);
    return ((after.value[0] == before.value[0]) && (after.standard_error[0] == before.standard_error[0]) &&
            (after.number == 0u))
               ? 0
               : 1;
}
