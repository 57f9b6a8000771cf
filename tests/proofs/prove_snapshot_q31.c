/* snapshot_strong_q31, snapshot_weak_q31: any state saved into any room; any bytes of any length
 * restored, whose bytes then are the state's but for its pointers. The hash of the configuration is arbitrary. */
#include "prove.h"

#include "persist/fingerprint_weak_q31.h"
#include "persist/fingerprint_q31.h"
#include "pvid/snapshot_weak_q31.h"
#include "pvid/snapshot_q31.h"
#include "pvid/strong_q31.h"

#define WEAK_BYTES PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_q31))
#define STRONG_BYTES PVID_SNAPSHOT_BYTES(sizeof(pvid_strong_q31))

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_strong_q31(const pvid_strong_config_q31 *config);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_model_q31(const pvid_weak_model_q31 *model);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_design_q31(const pvid_weak_design_q31 *design);

/*@ assigns \result \from \nothing; */
uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config);

static pvid_strong_q31 strong;
static pvid_strong_config_q31 strong_config;
static pvid_weak_q31 engine;
static pvid_weak_config_q31 engine_config;
static pvid_weak_design_q31 engine_design;
static pvid_weak_model_q31 engine_model;
static const pvid_model_q31 model = {.n_theta = 8, .n_p = 4};
static const int32_t limits[PVID_MAX_SAMPLES] = {0};
static uint8_t image[WEAK_BYTES + 4u];

static void any_image(void)
{
    Frama_C_make_unknown((char *)image, sizeof image);
}

static void any_engine(void)
{
    Frama_C_make_unknown((char *)&engine, sizeof engine);
    engine_design.model = &engine_model;
    engine_config.design = &engine_design;
    engine.design = &engine_design;
    engine.accumulator.design = &engine_design;
    engine.accumulator.front.offset = limits;
    engine.drive_min = limits;
    engine.estimator.model = &model;
    any_image();
    (void)pvid_snapshot_restore_weak_q31(&engine, &engine_config, image, any_u32(0, sizeof image));
    /*@ assert engine.design == &engine_design && engine.accumulator.design == &engine_design; */
    /*@ assert engine.accumulator.front.offset == &limits[0] && engine.drive_min == &limits[0]; */
    /*@ assert engine.estimator.model == &model; */
    (void)pvid_snapshot_save_weak_q31(&engine, &engine_config, any_u32(0, UINT32_MAX), image, any_u32(0, sizeof image));
}

void main(void)
{
    any_engine();
    Frama_C_make_unknown((char *)&strong, sizeof strong);
    strong.estimator.ready = true;
    strong.differentiator.bank.weights = pvid_five_points_q31;
    any_image();
    (void)pvid_snapshot_restore_strong_q31(&strong, &strong_config, image, any_u32(0, sizeof image));
    (void)pvid_snapshot_save_strong_q31(&strong, &strong_config, any_u32(0, UINT32_MAX), image,
                                        any_u32(0, sizeof image));
}
