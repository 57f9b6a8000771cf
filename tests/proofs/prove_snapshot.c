/* snapshot: two slots with any bytes in them, looked at with any identity; and one that is sealed. */
#include "prove.h"

#include "persist/snapshot.h"

#define ROOM 96u

static uint8_t slots[2][ROOM];

void main(void)
{
    for (size_t i = 0; i < ROOM; i++) {
        slots[0][i] = (uint8_t)any_u32(0, 255);
        slots[1][i] = (uint8_t)any_u32(0, 255);
    }
    const pvid_snapshot_identity identity = {
        .kind = PVID_SNAPSHOT_KIND_WEAK_Q31,
        .layout = any_u32(0, UINT32_MAX),
        .config = any_u32(0, UINT32_MAX),
        .bytes = any_u32(0, ROOM - PVID_SNAPSHOT_HEADER - 4u),
    };
    (void)pvid_snapshot_inspect(slots[0], any_u32(0, ROOM), &identity);
    (void)pvid_snapshot_choose(slots[0], slots[1], any_u32(0, ROOM));
    (void)pvid_snapshot_seal(slots[0], &identity, any_u32(0, UINT32_MAX));
}
