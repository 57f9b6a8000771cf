/* snapshot_strong_q31, snapshot_weak_q31: any state saved into any room; any bytes of any length restored, whose bytes
 * then are the state's but for its pointers. The hash of the configuration is arbitrary. */
#include "prove.h"

#include "keep/fingerprint_q31.h"
#include "pvid/snapshot_q31.h"
#include "pvid/strong_q31.h"
#include "pvid/weak_q31.h"

#define WEAK_BYTES PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_q31))
#define STRONG_BYTES PVID_SNAPSHOT_BYTES(sizeof(pvid_strong_q31))

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_strong_q31(const pvid_strong_config_q31 *config);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config);

static pvid_weak_q31 weak;
static pvid_strong_q31 strong;
static pvid_weak_config_q31 weak_config;
static pvid_strong_config_q31 strong_config;
static pvid_weak_design_q31 design;
static uint8_t image[WEAK_BYTES + 4u];

static void any_image(void)
{
    Frama_C_make_unknown((char *)image, sizeof image);
}

void main(void)
{
    Frama_C_make_unknown((char *)&weak, sizeof weak);
    Frama_C_make_unknown((char *)&strong, sizeof strong);
    weak.design = &design;
    weak.estimator.model = &pvid_kapitza_weak_q31;
    strong.estimator.ready = true;
    strong.differentiator.bank.weights = pvid_five_points_q31;
    weak_config.design = &design;
    any_image();
    (void)pvid_snapshot_restore_weak_q31(&weak, &weak_config, image, any_u32(0, sizeof image));
    /*@ assert weak.design == &design && weak.estimator.model == &pvid_kapitza_weak_q31; */
    any_image();
    (void)pvid_snapshot_restore_strong_q31(&strong, &strong_config, image, any_u32(0, sizeof image));
    (void)pvid_snapshot_save_weak_q31(&weak, &weak_config, any_u32(0, UINT32_MAX), image, any_u32(0, sizeof image));
    (void)pvid_snapshot_save_strong_q31(&strong, &strong_config, any_u32(0, UINT32_MAX), image,
                                        any_u32(0, sizeof image));
}
