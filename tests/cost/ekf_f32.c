#include "ekf_f32.h"

/* Start of the motion: a release within about 0.2 rad, rates of a rad/s, q = phi''/w of the size of phi. */
static const float motion_sd[EKF_MOTION] = {0.0f, 1.0f, 0.2f, 1.0f};

void ekf_init_f32(ekf_f32 *self, const ekf_config_f32 *config)
{
    *self = (ekf_f32){.config = *config};
    self->p[0][0] = config->angle_variance;
    for (uint8_t i = 1; i < EKF_MOTION; i++) {
        self->p[i][i] = motion_sd[i] * motion_sd[i];
    }
    for (uint8_t i = 0; i < 3u; i++) {
        self->x[EKF_MOTION + i] = config->start[i];
        self->p[EKF_MOTION + i][EKF_MOTION + i] = config->start_sd[i] * config->start_sd[i];
    }
}

/* The first EKF_MOTION rows of F = 1 + dt A + dt^2/2 A^2 without their zeros; the others are those of 1. */
typedef struct {
    float dt, half; /* dt, dt^2/2 */
    float g, q;
    float by_angle, by_q; /* -d2 G, -d1 G */
    float r;              /* d q''/d w = -d1 q - d2 phi */
    float gq, ga;         /* -G q, -G phi */
} transition;

static transition transition_of(const ekf_f32 *self, float u)
{
    const float *x = self->x;
    const float g = x[4] + u;
    const float dt = self->config.dt;
    return (transition){
        .dt = dt,
        .half = 0.5f * dt * dt,
        .g = g,
        .q = x[2],
        .by_angle = -(x[6] * g),
        .by_q = -(x[5] * g),
        .r = -(x[5] * x[2]) - (x[6] * x[0]),
        .gq = -(g * x[2]),
        .ga = -(g * x[0]),
    };
}

/* out = F v. */
static void apply(const transition *f, const float v[EKF_N], float out[EKF_MOTION])
{
    const float phi2 = (f->g * v[2]) + (f->q * v[4]);
    const float q2 = (f->by_angle * v[0]) + (f->by_q * v[2]) + (f->r * v[4]) + (f->gq * v[5]) + (f->ga * v[6]);
    out[0] = v[0] + (f->dt * v[1]) + (f->half * phi2);
    out[1] = v[1] + (f->dt * phi2) + (f->half * (f->g * v[3]));
    out[2] = v[2] + (f->dt * v[3]) + (f->half * q2);
    out[3] = v[3] + (f->dt * q2) + (f->half * ((f->by_angle * v[1]) + (f->by_q * v[3])));
}

static void predict_covariance(ekf_f32 *self, const transition *f)
{
    float top[EKF_MOTION][EKF_N]; /* F P */
    for (uint8_t j = 0; j < EKF_N; j++) {
        float out[EKF_MOTION];
        apply(f, self->p[j], out); /* P is symmetric: its row j is its column j */
        for (uint8_t i = 0; i < EKF_MOTION; i++) {
            top[i][j] = out[i];
        }
    }
    for (uint8_t i = 0; i < EKF_MOTION; i++) {
        float out[EKF_MOTION];
        apply(f, top[i], out); /* row i of F P F^T */
        for (uint8_t j = 0; j <= i; j++) {
            self->p[i][j] = out[j];
            self->p[j][i] = out[j];
        }
        for (uint8_t j = EKF_MOTION; j < EKF_N; j++) {
            self->p[i][j] = top[i][j];
            self->p[j][i] = top[i][j];
        }
    }
    const float w = self->x[4];
    self->p[1][1] += self->config.rate_noise;
    self->p[3][3] += self->config.rate_noise / (w * w);
}

/* exp(A dt) x to the third order: the linear motion at the present w, d1, d2. */
static void predict_state(ekf_f32 *self, const transition *f)
{
    float term[EKF_MOTION] = {self->x[0], self->x[1], self->x[2], self->x[3]};
    static const float inverse[3] = {1.0f, 1.0f / 2.0f, 1.0f / 3.0f};
    for (uint8_t order = 0; order < 3u; order++) {
        const float step = f->dt * inverse[order];
        const float rate1 = f->g * term[2];
        const float rate3 = (f->by_angle * term[0]) + (f->by_q * term[2]);
        term[0] = step * term[1];
        term[1] = step * rate1;
        term[2] = step * term[3];
        term[3] = step * rate3;
        for (uint8_t i = 0; i < EKF_MOTION; i++) {
            self->x[i] += term[i];
        }
    }
}

static void correct(ekf_f32 *self, float phi)
{
    const float inverse = 1.0f / (self->p[0][0] + self->config.angle_variance);
    const float e = phi - self->x[0];
    float first[EKF_N];
    for (uint8_t i = 0; i < EKF_N; i++) {
        first[i] = self->p[0][i];
    }
    for (uint8_t i = 0; i < EKF_N; i++) {
        const float gain = first[i] * inverse;
        self->x[i] += gain * e;
        for (uint8_t j = 0; j <= i; j++) {
            self->p[i][j] -= gain * first[j];
            self->p[j][i] = self->p[i][j];
        }
    }
}

static void filter(ekf_f32 *self, float phi, float u)
{
    if (self->started) {
        const transition f = transition_of(self, 0.5f * (self->u + u));
        predict_covariance(self, &f);
        predict_state(self, &f);
    } else {
        self->x[0] = phi;
        self->started = true;
    }
    self->u = u;
    correct(self, phi);
}

bool ekf_sample_f32(ekf_f32 *self, float phi, float y)
{
    self->angles[self->head] = phi;
    self->heights[self->head] = y;
    self->head = (uint16_t)((self->head + 1u == EKF_TAPS) ? 0u : (self->head + 1u));
    if (self->filled < EKF_TAPS) {
        self->filled++;
        if (self->filled < EKF_TAPS) {
            return false;
        }
    }
    uint16_t centre = (uint16_t)(self->head + EKF_HALF);
    centre = (uint16_t)((centre >= EKF_TAPS) ? (centre - EKF_TAPS) : centre);
    uint16_t newer = centre;
    uint16_t older = centre;
    const float middle = self->heights[centre];
    float u = 0.0f;
    for (uint8_t i = 0; i < EKF_HALF; i++) {
        newer = (uint16_t)((newer + 1u == EKF_TAPS) ? 0u : (newer + 1u));
        older = (uint16_t)((older == 0u) ? (EKF_TAPS - 1u) : (older - 1u));
        u += self->config.second[i] * ((self->heights[newer] - middle) + (self->heights[older] - middle));
    }
    filter(self, self->angles[centre], u);
    return true;
}
