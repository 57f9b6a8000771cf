/* excite_f32: any table of parts, any envelope and any limits that init accepts, any phase: every sum, phase and
 * conversion stays within its type, and the drive within its limits. */
#include "prove.h"

#include "pvid/excite.h"

/* Any number of low..high. */
static float any_f32(float low, float high)
{
    return Frama_C_float_interval(low, high);
}

static pvid_excite_part_f32 part[2];
static pvid_excite_config_f32 config;
static const float level[2] = {-1.0f, 1.0f};

static void any_part(pvid_excite_part_f32 *one)
{
    one->kind = (pvid_excite_kind)any_u32(0u, 3u);
    one->amplitude = any_f32(0.0f, PVID_EXCITE_MOST);
    one->hz = any_f32(1.0e-3f, 5.0e5f);
    one->turns = any_f32(0.0f, 1.0f);
    one->to_hz = any_f32(1.0e-3f, 5.0e5f);
    one->sweep_s = any_f32(1.0e-6f, 1.0e6f);
    one->level = level;
    one->levels = 2u;
}

void main(void)
{
    static pvid_excite_f32 self;
    const float measured[1] = {0.0f};
    any_part(&part[0]);
    any_part(&part[1]);
    config.sample_rate_hz = any_f32(1.0f, 1.0e6f);
    config.low = any_f32(-PVID_EXCITE_MOST, 0.0f);
    config.high = any_f32(0.0f, PVID_EXCITE_MOST);
    config.slew = any_f32(1.0f, 1.0e12f);
    config.ramp_s = any_f32(1.0e-3f, 1.0e2f);
    config.burst_s = any_f32(1.0e-3f, 1.0e2f);
    config.part = part;
    config.parts = 2u;
    config.measured = 1u;
    if (pvid_excite_init_f32(&self, &config) == PVID_OK) {
        (void)pvid_excite_start_f32(&self, any_f32(0.0f, 1.0f), any_u32(0u, UINT32_MAX));
        while (any_bool()) {
            const float drive = pvid_excite_step_f32(&self, measured);
            /*@ assert -1.0e6 <= drive <= 1.0e6; */
            if (any_bool()) {
                pvid_excite_stop_f32(&self);
            }
            if (any_bool()) {
                pvid_excite_abort_f32(&self);
            }
        }
    }
}
