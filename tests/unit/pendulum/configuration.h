/* The weak form of the pendulum in both cores, for programs that have both: the tables of the two designs have the
 * same names. */
#ifndef PENDULUM_CONFIGURATION_H
#define PENDULUM_CONFIGURATION_H

#include "pvid/fourier.h"
#include "pvid/fourier_q31.h"

extern const pvid_fourier_config_f32 *const pendulum_config_f32;
extern const pvid_fourier_config_q31 *const pendulum_config_q31;

#endif
