#include "kapitza_design_q31.h"
#include "configuration.h"

const pvid_weak_config_q31 *const pendulum_config_q31 = &kapitza_config_q31;
