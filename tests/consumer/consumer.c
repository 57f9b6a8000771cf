/* Identifies a little with the library it is linked with, and shows that both agree on the struct:
 * init clears exactly the bytes that this file sees in the identifier.
 *
 * Prints "version MAJOR.MINOR.PATCH taps PVID_MAX_TAPS hash HASH". */
#include <stdio.h>
#include <string.h>

#include "pvid/pvid.h"

#define TAPS 7
#define WINDOW 65
#define FUNCTIONS 4
#define PAIRS ((FUNCTIONS * (FUNCTIONS + 1)) / 2)

static const float smooth[(TAPS - 1) / 2] = {0.3f, 0.1f, -0.1f};
static const float second[(TAPS - 1) / 2] = {0.0f, 0.1f, 0.1f};
static float chi[WINDOW * 3 * FUNCTIONS];
static float gram[6 * PAIRS];

static const pvid_weak_design_f32 design = {
    .taps = TAPS,
    .decimation = 4,
    .window = WINDOW,
    .functions = FUNCTIONS,
    .smooth = smooth,
    .second = second,
    .chi = chi,
    .gram = gram,
    .overlap = 1.5f,
    .lag = 8,
};

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
    for (int i = 0; i < WINDOW * 3 * FUNCTIONS; i++) {
        chi[i] = 0.01f * (float)((i * 37) % 101 - 50);
    }
    for (int row = 0; row < FUNCTIONS; row++) {
        gram[((row * (row + 1)) / 2) + row] = 1.0f;
    }
    pvid_weak_config_f32 config = {
        .sample_rate_hz = 1000.0f,
        .l1 = 0.3f,
        .design = &design,
        .zero_unknown = true,
        .iterations = 1,
        .estimator = pvid_estimator_defaults_f32,
        .trust = pvid_trust_defaults_f32,
    };
    const float start[4] = {30.0f, 9.0f, 5.0f, 0.0f};
    for (int i = 0; i < 4; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = (i < 3) ? start[i] : 0.5f;
        config.estimator.lower[i] = (i < 3) ? 0.01f : -3.0f;
        config.estimator.upper[i] = (i < 3) ? 1.0e4f : 3.0f;
    }
    config.estimator.row_sd = 1.0e-3f;
    memset(&guarded, 0xA5, sizeof guarded);
    const pvid_status status = pvid_weak_init_f32(&guarded.identifier, &config);
    if (status != PVID_OK) {
        fprintf(stderr, "init: status %d\n", (int)status);
        return 1;
    }
    if (!layouts_agree()) {
        fprintf(stderr, "library and header disagree on the size of pvid_weak_f32\n");
        return 1;
    }
    uint32_t hash = 0x811C9DC5u;
    for (int tick = 0; tick < 2000; tick++) {
        const float phi = 1.0e-3f * (float)((tick * 13) % 97 - 48);
        const float y = 1.0e-4f * (float)((tick * 29) % 89 - 44);
        const pvid_reason reason = pvid_weak_step_f32(&guarded.identifier, phi, y);
        hash = pvid_fnv_estimator_f32(hash, &guarded.identifier.estimator, reason);
    }
    printf("version %s taps %d hash %08lx\n", version, PVID_MAX_TAPS, (unsigned long)hash);
    return 0;
}
