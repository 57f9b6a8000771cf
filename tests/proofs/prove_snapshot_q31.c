/* snapshot_weak_q31: any state saved into any room; any bytes of any length restored, whose bytes then are the state's
 * but for its pointers. The hash of the configuration is arbitrary. */
#include "prove.h"

#include "persist/fingerprint_weak_q31.h"
#include "pvid/snapshot_weak_q31.h"

#define WEAK_BYTES PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_q31))

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_model_q31(const pvid_weak_model_q31 *model);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_design_q31(const pvid_weak_design_q31 *design);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config);

static pvid_weak_q31 identifier;
static pvid_weak_config_q31 weak_config;
static pvid_weak_design_q31 weak_design;
static pvid_weak_model_q31 weak_model;
static const pvid_model_q31 model = {.n_theta = 8, .n_p = 4};
static const int32_t limits[PVID_MAX_SAMPLES] = {0};
static uint8_t image[WEAK_BYTES + 4u];

void main(void)
{
    Frama_C_make_unknown((char *)&identifier, sizeof identifier);
    weak_design.model = &weak_model;
    weak_config.design = &weak_design;
    identifier.design = &weak_design;
    identifier.accumulator.design = &weak_design;
    identifier.accumulator.front.offset = limits;
    identifier.drive_min = limits;
    identifier.trust.config.shared = limits;
    identifier.estimator.model = &model;
    Frama_C_make_unknown((char *)image, sizeof image);
    (void)pvid_snapshot_restore_weak_q31(&identifier, &weak_config, image, any_u32(0, sizeof image));
    /*@ assert identifier.design == &weak_design && identifier.accumulator.design == &weak_design; */
    /*@ assert identifier.accumulator.front.offset == &limits[0] && identifier.drive_min == &limits[0]; */
    /*@ assert identifier.trust.config.shared == &limits[0]; */
    /*@ assert identifier.estimator.model == &model; */
    (void)pvid_snapshot_save_weak_q31(&identifier, &weak_config, any_u32(0, UINT32_MAX), image,
                                      any_u32(0, sizeof image));
}
