/* The tables of the design in float32, which fuzz_api.c includes, have the same names. */
#include "pendulum/kapitza_design_q31.h"
#include "pendulum_q31.h"

const pvid_weak_config_q31 *const pendulum_config_q31 = &kapitza_config_q31;
