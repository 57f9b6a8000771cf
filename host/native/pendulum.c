#include "pendulum.h"

#include <math.h>

/* What does not change during a run. */
typedef struct {
    const pvid_pendulum *rig;
    double m11, m22, m12; /* entries of the mass matrix; m12 times the cosine */
    double up, across;    /* components of the slide's direction */
    int is_dry;
} plant;

static void derivative(const plant *self, const double x[4], double acceleration, double out[4])
{
    const pvid_pendulum *rig = self->rig;
    const double v1 = x[2];
    const double v2 = x[3];
    const double s1 = sin(x[0]);
    const double c1 = cos(x[0]);
    const double s2 = sin(x[1]);
    const double c2 = cos(x[1]);
    const double m12 = self->m12 * (c1 * c2 + s1 * s2);
    const double coupling = self->m12 * (s1 * c2 - c1 * s2);
    const double gravity = rig->g + acceleration * self->up;
    const double aside = acceleration * self->across;
    double at_pivot = rig->viscous[0] * v1;
    double at_joint = rig->viscous[1] * (v2 - v1);
    if (self->is_dry) {
        at_pivot += rig->dry[0] * tanh(v1 / rig->slip);
        at_joint += rig->dry[1] * tanh((v2 - v1) / rig->slip);
    }
    const double torque1 = -coupling * v2 * v2 - rig->l1 * (gravity * s1 + aside * c1) - at_pivot + at_joint;
    const double torque2 = coupling * v1 * v1 - rig->l2 * (gravity * s2 + aside * c2) - at_joint;
    const double determinant = self->m11 * self->m22 - m12 * m12;
    out[0] = v1;
    out[1] = v2;
    out[2] = (self->m22 * torque1 - m12 * torque2) / determinant;
    out[3] = (self->m11 * torque2 - m12 * torque1) / determinant;
}

uint32_t pvid_pendulum_run(const pvid_pendulum *self, const double x[4], const double acceleration[], uint32_t steps,
                           double step_s, double limit, double out[])
{
    plant p;
    p.rig = self;
    p.m11 = self->l1 * self->l1;
    p.m22 = self->l2 * self->l2 + self->rho2 * self->rho2;
    p.m12 = self->l1 * self->l2;
    p.up = cos(self->slant);
    p.across = sin(self->slant);
    p.is_dry = self->dry[0] > 0.0 || self->dry[1] > 0.0;
    for (int i = 0; i < 4; i++) {
        out[i] = x[i];
    }
    for (uint32_t step = 0; step < steps; step++) {
        const double *from = &out[4 * (size_t)step];
        double *to = &out[4 * (size_t)(step + 1u)];
        const double *a = &acceleration[2 * (size_t)step];
        double k1[4], k2[4], k3[4], k4[4], middle[4];
        derivative(&p, from, a[0], k1);
        for (int i = 0; i < 4; i++) {
            middle[i] = from[i] + 0.5 * step_s * k1[i];
        }
        derivative(&p, middle, a[1], k2);
        for (int i = 0; i < 4; i++) {
            middle[i] = from[i] + 0.5 * step_s * k2[i];
        }
        derivative(&p, middle, a[1], k3);
        for (int i = 0; i < 4; i++) {
            middle[i] = from[i] + step_s * k3[i];
        }
        derivative(&p, middle, a[2], k4);
        for (int i = 0; i < 4; i++) {
            to[i] = from[i] + step_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        if (!(fabs(to[0]) <= limit && fabs(to[1]) <= limit && fabs(to[2] + to[3]) < 1e6)) {
            return step + 1u;
        }
    }
    return steps + 1u;
}
