/* The estimate survives a power cut: two slots in flash, written in turn. If the power fails during a write, the other
 * slot is still whole. */
#include <stdio.h>
#include <string.h>

#include "dc_motor_example.h"
#include "pvid/snapshot_slots.h"

#define SLOT 16384u /* a multiple of the flash's pages, at least dc_motor_snapshot_size() */

static uint8_t flash[2][SLOT]; /* your board: two areas of its flash */
static uint8_t image[SLOT];

/* Your board: erases the slot and writes `length` bytes. Here the power may fail behind some of them. */
static void flash_write(uint8_t slot, size_t length, size_t power)
{
    memset(flash[slot], 0xFF, SLOT);
    memcpy(flash[slot], image, (length < power) ? length : power);
}

static void save(size_t power)
{
    const pvid_snapshot_choice choice = pvid_snapshot_choose(flash[0], flash[1], SLOT);
    const size_t length = dc_motor_snapshot_save(choice.generation, image, SLOT);
    if (length > 0u) {
        flash_write(choice.next, length, power);
    }
}

/* After a reset: begin, then the newest slot that is whole. */
static bool restored(void)
{
    if (dc_motor_begin() != PVID_OK) {
        return false;
    }
    const pvid_snapshot_choice choice = pvid_snapshot_choose(flash[0], flash[1], SLOT);
    return (choice.newest >= 0) && dc_motor_snapshot_restore(flash[choice.newest], SLOT);
}

int main(void)
{
    float value[DC_MOTOR_PARAMETERS];
    float error[DC_MOTOR_PARAMETERS];
    float sample[DC_MOTOR_SAMPLES];
    memset(flash, 0xFF, sizeof flash);
    if ((dc_motor_snapshot_size() > SLOT) || restored()) { /* the flash is empty: nothing to restore */
        return 1;
    }
    for (uint32_t tick = 0; dc_motor_example_sample(tick, sample); tick++) {
        (void)dc_motor_step(sample);
    }
    save(SLOT);
    const uint32_t before = dc_motor_read(value, error);
    save(1000u); /* the power fails behind 1000 bytes of the second slot */
    if (!restored()) {
        return 1;
    }
    const uint32_t after = dc_motor_read(value, error);
    printf("%u estimates before the power cut, %u after it; %s = %g\n", (unsigned)before, (unsigned)after,
           dc_motor_parameter[0], (double)value[0]);
    return ((before > 0u) && (after == before)) ? 0 : 1;
}
