/* Identifies a little with the library it is linked with, and shows that both agree on the struct:
 * init clears exactly the bytes that this file sees in the identifier.
 *
 * Prints "version MAJOR.MINOR.PATCH harmonics PVID_MAX_HARMONICS hash HASH". */
#include <stdio.h>
#include <string.h>

#include "../unit/first_order.h"
#include "pvid/pvid.h"

static struct {
    pvid_weak_f32 identifier;
    unsigned char after[64];
} guarded;

static const char *package_version(void)
{
#ifdef PACKAGE_VERSION
    return PACKAGE_VERSION;
#else
    return NULL;
#endif
}

static int layouts_agree(void)
{
    const unsigned char *bytes = (const unsigned char *)&guarded.identifier;
    const unsigned char *end = bytes + sizeof guarded.identifier;
    for (size_t i = 0; i < sizeof guarded.after; i++) {
        if (guarded.after[i] != 0xA5u) {
            return 0; /* the library's struct is longer */
        }
    }
    return end[-1] != 0xA5u; /* else the library's is shorter */
}

int main(void)
{
    char version[32];
    snprintf(version, sizeof version, "%d.%d.%d", PVID_VERSION_MAJOR, PVID_VERSION_MINOR, PVID_VERSION_PATCH);
    if ((package_version() != NULL) && (strcmp(version, package_version()) != 0)) {
        fprintf(stderr, "header %s, package %s\n", version, package_version());
        return 1;
    }
    const pvid_weak_design_f32 design = design_of(&mechanism);
    const pvid_weak_config_f32 config = config_of(&design);
    memset(&guarded, 0xA5, sizeof guarded);
    const pvid_status status = pvid_weak_init_f32(&guarded.identifier, &config);
    if (status != PVID_OK) {
        fprintf(stderr, "init: %s\nlibrary: %s\napplication: %s\n", pvid_status_text(status), pvid_layout_sizes(),
                PVID_LAYOUT_SIZES);
        return 1;
    }
    if (!layouts_agree()) {
        fprintf(stderr, "library and header disagree on the size of pvid_weak_f32\n");
        return 1;
    }
    uint32_t hash = 0x811C9DC5u;
    for (int tick = 0; tick < 2000; tick++) {
        const float sample[2] = {0.1f * (float)((tick * 13) % 97 - 48), 0.01f * (float)((tick * 29) % 89 - 44)};
        const pvid_reason reason = pvid_weak_step_f32(&guarded.identifier, sample);
        hash = pvid_fnv_estimator_f32(hash, &guarded.identifier.estimator, reason);
    }
    printf("version %s harmonics %d hash %08lx\n", version, PVID_MAX_HARMONICS, (unsigned long)hash);
    return 0;
}
