/* The weak form of the pendulum in both cores, for programs that have both: the tables of the two designs have the
 * same names. */
#ifndef PENDULUM_CONFIGURATION_H
#define PENDULUM_CONFIGURATION_H

#include "pvid/weak.h"
#include "pvid/weak_q31.h"

extern const pvid_weak_config_f32 *const pendulum_config_f32;
extern const pvid_weak_config_q31 *const pendulum_config_q31;

#endif
