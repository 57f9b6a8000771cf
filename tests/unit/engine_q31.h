/* The pendulum's weak form in fixed point for the tests: functions and tables of pendulum/, readings of the standard
 * rig. In one source of each program. */
#ifndef ENGINE_Q31_H
#define ENGINE_Q31_H

#include <math.h>

#include "pendulum/kapitza_design_q31.h"
#include "pendulum/kapitza_weak_q31.c"
#include "plant.h"

#define ENGINE_HOP_TICKS (32 * 24) /* from window to window, of kapitza_design_q31.h */

enum { ENGINE_Y, ENGINE_PHI };

/* What a count of y [m], of phi [rad] and an integer of each p stand for. */
static const double engine_lsb[2] = {5.0e-6, 3.834951969714103e-4};
static const double engine_p_unit[4] = {1.0 / 262144.0, 1.0 / 1048576.0, 1.0 / 1048576.0, 1.0 / 134217728.0};

/* The plant's next sample, the encoder's zero at so many counts. */
static inline void engine_reading(plant_state *plant, int32_t zero, int32_t reading[2])
{
    double phi;
    double y;
    plant_step(plant, &phi, &y);
    reading[ENGINE_Y] = (int32_t)floor((y / engine_lsb[ENGINE_Y]) + 0.5);
    reading[ENGINE_PHI] = (int32_t)floor((phi / engine_lsb[ENGINE_PHI]) + 0.5) + zero;
}

#endif
