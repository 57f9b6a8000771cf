#include "kapitza_design_f32.h"
#include "configuration.h"

const pvid_weak_config_f32 *const pendulum_config_f32 = &kapitza_config_f32;
