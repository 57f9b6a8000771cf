/* The pendulum's weak form in fixed point for the tests: functions and tables of build/pendulum, readings of the
 * standard rig. In one source of each program. */
#ifndef KAPITZA_PLANT_Q31_H
#define KAPITZA_PLANT_Q31_H

#include <math.h>

#include "pendulum/kapitza_design_q31.h"
#include "pendulum/kapitza_weak_q31.c"
#include "plant.h"

#define PLANT_HOP_TICKS (32 * 24) /* from window to window, of kapitza_design_q31.h */

enum { PLANT_Y, PLANT_PHI };

/* What a count of y [m], of phi [rad] and an integer of each p stand for. */
static const double plant_lsb[2] = {5.0e-6, 3.834951969714103e-4};
static const double plant_p_unit[4] = {1.0 / 262144.0, 1.0 / 1048576.0, 1.0 / 1048576.0, 1.0 / 134217728.0};

/* The plant's next sample, the encoder's zero at so many counts. */
static inline void plant_reading(plant_state *plant, int32_t zero, int32_t reading[2])
{
    double phi;
    double y;
    plant_step(plant, &phi, &y);
    reading[PLANT_Y] = (int32_t)floor((y / plant_lsb[PLANT_Y]) + 0.5);
    reading[PLANT_PHI] = (int32_t)floor((phi / plant_lsb[PLANT_PHI]) + 0.5) + zero;
}

#endif
