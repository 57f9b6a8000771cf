#ifndef PENDULUM_Q31_H
#define PENDULUM_Q31_H

#include "pvid/weak_q31.h"

extern const pvid_weak_config_q31 *const pendulum_config_q31;

#endif
