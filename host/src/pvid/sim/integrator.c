/* RK4 of A h = r (functions equations_* above), with frictions that are soft (tanh) or sharp: located reversals,
 * sticking. STATE_OF[i]: the state that is the argument of sign i, or -1. */
#include <math.h>
#include <string.h>

enum { MOST_EVENTS = 64, HALVINGS = 60, NONE = 0, BROKEN = 1 };
#define AT_LEAST_1(n) ((n) > 0 ? (n) : 1)

typedef struct {
    const double *p;       /* unknowns, then knowns */
    const double *w;       /* [N] added to the right side: disturbance */
    double width;          /* of a soft sign; 0: sharp */
    double breakaway;      /* friction that holds at rest, over the one that slides; >= 1 */
    int m[AT_LEAST_1(NS)]; /* sharp: -1, 1: slides that way; 0: sticks */
    int fault;
} plant;

/* A x = b by elimination with pivots; b becomes x. */
static int solve(int n, double *A, double *b, int stride)
{
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i * stride + k]) > fabs(A[best * stride + k]))
                best = i;
        if (!(fabs(A[best * stride + k]) > 0.0))
            return BROKEN;
        if (best != k) {
            for (int j = 0; j < n; j++) {
                const double held = A[k * stride + j];
                A[k * stride + j] = A[best * stride + j];
                A[best * stride + j] = held;
            }
            const double held = b[k];
            b[k] = b[best];
            b[best] = held;
        }
        for (int i = k + 1; i < n; i++) {
            const double f = A[i * stride + k] / A[k * stride + k];
            for (int j = k + 1; j < n; j++)
                A[i * stride + j] -= f * A[k * stride + j];
            b[i] -= f * b[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++)
            b[i] -= A[i * stride + j] * b[j];
        b[i] /= A[i * stride + i];
    }
    return NONE;
}

/* Rates d and highest derivatives h at given signs. */
static void at_signs(plant *of, const double *x, const double *u, const double *s, double *d, double *h)
{
    double A[N][N];
    equations_system(x, u, of->p, s, A, h);
    if (of->w)
        for (int i = 0; i < N; i++)
            h[i] += of->w[i];
    if (solve(N, &A[0][0], h, N) == BROKEN)
        of->fault = BROKEN;
    equations_rates(x, u, of->p, s, h, d);
}

/* Signs in the present modes: those that stick take the value at which their argument stays. BROKEN: there is none. */
static int signs(plant *of, const double *x, const double *u, double *s)
{
    double d[AT_LEAST_1(NX)], h[N], g0[AT_LEAST_1(NS)], g[AT_LEAST_1(NS)], b[AT_LEAST_1(NS)];
    double M[AT_LEAST_1(NS) * AT_LEAST_1(NS)];
    int stuck[AT_LEAST_1(NS)], n = 0;
    if (of->width > 0.0) {
        equations_arguments(x, u, of->p, s, s);
        for (int i = 0; i < NS; i++)
            s[i] = tanh(s[i] / of->width);
        return NONE;
    }
    for (int i = 0; i < NS; i++) {
        s[i] = of->m[i];
        if (of->m[i] == 0)
            stuck[n++] = i;
    }
    if (n == 0)
        return NONE;
    at_signs(of, x, u, s, d, h);
    equations_slopes(x, u, of->p, s, d, g0);
    for (int j = 0; j < n; j++) {
        s[stuck[j]] = 1.0;
        at_signs(of, x, u, s, d, h);
        equations_slopes(x, u, of->p, s, d, g);
        s[stuck[j]] = 0.0;
        for (int i = 0; i < n; i++)
            M[i * n + j] = g[stuck[i]] - g0[stuck[i]];
    }
    for (int i = 0; i < n; i++)
        b[i] = -g0[stuck[i]];
    if (solve(n, M, b, n) == BROKEN)
        return BROKEN;
    for (int i = 0; i < n; i++)
        s[stuck[i]] = b[i];
    return NONE;
}

static void field(plant *of, const double *x, const double *u, double *d, double *h)
{
    double s[AT_LEAST_1(NS)];
    signs(of, x, u, s);
    at_signs(of, x, u, s, d, h);
}

/* Inputs at a part of a step: the parabola through those at its start, middle and end; u3 is [3][NU]. */
static void inputs_at(const double *u3, int smooth, double part, double *u)
{
    for (int i = 0; i < NU; i++) {
        const double a = u3[i], b = smooth ? u3[NU + i] : a, c = smooth ? u3[2 * NU + i] : a;
        u[i] = a + part * (-3.0 * a + 4.0 * b - c) + part * part * (2.0 * a - 4.0 * b + 2.0 * c);
    }
}

/* From part `from` to part `to` of a step of length h. */
static void rk4(plant *of, const double *x, const double *u3, int smooth, double h, double from, double to, double *out)
{
    double u[AT_LEAST_1(NU)], y[AT_LEAST_1(NX)], k[4][AT_LEAST_1(NX)], top[N];
    const double step = (to - from) * h;
    inputs_at(u3, smooth, from, u);
    field(of, x, u, k[0], top);
    inputs_at(u3, smooth, 0.5 * (from + to), u);
    for (int i = 0; i < NX; i++)
        y[i] = x[i] + 0.5 * step * k[0][i];
    field(of, y, u, k[1], top);
    for (int i = 0; i < NX; i++)
        y[i] = x[i] + 0.5 * step * k[1][i];
    field(of, y, u, k[2], top);
    inputs_at(u3, smooth, to, u);
    for (int i = 0; i < NX; i++)
        y[i] = x[i] + step * k[2][i];
    field(of, y, u, k[3], top);
    for (int i = 0; i < NX; i++)
        out[i] = x[i] + step / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    for (int i = 0; i < NS; i++) /* what sticks does not creep by rounding */
        if (of->width == 0.0 && of->m[i] == 0 && STATE_OF[i] >= 0)
            out[STATE_OF[i]] = 0.0;
}

/* The first sign whose mode no longer holds: reversed, or torn loose; -1: none. */
static int broken_mode(plant *of, const double *x, const double *u)
{
    double a[AT_LEAST_1(NS)], s[AT_LEAST_1(NS)];
    if (NS == 0 || of->width > 0.0)
        return -1;
    equations_arguments(x, u, of->p, a, a);
    signs(of, x, u, s);
    for (int i = 0; i < NS; i++)
        if (of->m[i] == 0 ? fabs(s[i]) > of->breakaway : a[i] * of->m[i] < 0.0)
            return i;
    return -1;
}

/* At an argument of 0: it sticks, or goes the way that the forces push it. Where no friction holds it, because it is
 * 0 or a drive sets the argument, it reverses. */
static void decide(plant *of, double *x, const double *u, int i)
{
    double s[AT_LEAST_1(NS)];
    const int reversed = of->m[i] > 0 ? -1 : 1;
    of->m[i] = 0;
    if (signs(of, x, u, s) == BROKEN)
        of->m[i] = reversed;
    else if (fabs(s[i]) > of->breakaway)
        of->m[i] = s[i] > 0.0 ? 1 : -1;
    else if (STATE_OF[i] >= 0)
        x[STATE_OF[i]] = 0.0;
}

static void advance(plant *of, double *x, const double *u3, int smooth, double h)
{
    double from = 0.0, y[AT_LEAST_1(NX)], u[AT_LEAST_1(NU)];
    for (int events = 0; from < 1.0; events++) {
        rk4(of, x, u3, smooth, h, from, 1.0, y);
        inputs_at(u3, smooth, 1.0, u);
        if (events >= MOST_EVENTS || broken_mode(of, y, u) < 0) {
            memcpy(x, y, sizeof(double) * NX);
            return;
        }
        double low = from, high = 1.0; /* all modes hold at low, not at high */
        for (int i = 0; i < HALVINGS && high - low > 1e-13; i++) {
            const double middle = 0.5 * (low + high);
            rk4(of, x, u3, smooth, h, from, middle, y);
            inputs_at(u3, smooth, middle, u);
            if (broken_mode(of, y, u) < 0)
                low = middle;
            else
                high = middle;
        }
        rk4(of, x, u3, smooth, h, from, high, y);
        inputs_at(u3, smooth, high, u);
        memcpy(x, y, sizeof(double) * NX);
        const int which = broken_mode(of, x, u);
        if (which >= 0)
            decide(of, x, u, which);
        from = high;
    }
}

/* Modes at a start: by the arguments; one that is 0 sticks or goes. */
static void begin(plant *of, double *x, const double *u)
{
    double a[AT_LEAST_1(NS)];
    if (NS == 0 || of->width > 0.0)
        return;
    equations_arguments(x, u, of->p, a, a);
    for (int i = 0; i < NS; i++)
        of->m[i] = a[i] > 0.0 ? 1 : -1;
    for (int i = 0; i < NS; i++)
        if (a[i] == 0.0)
            decide(of, x, u, i);
}

/* n samples of `sub` steps of h [s].
 *   x [NX]: state at the start, then at the end
 *   modes [NS]: of the frictions, likewise; read unless `fresh`
 *   u: held inputs [n][NU], or smooth ones [n][sub][3][NU] at start, middle and end of each step
 *   w: disturbances [n][N], held, or null
 *   out: [n][NX + N] at the samples: states, highest derivatives; with every_step [n][sub][NX + N]
 * Returns 0; 1: the highest derivatives are not determined somewhere. */
int plant_run(double *x, int *modes, int fresh, const double *u, int smooth, const double *w, const double *p,
              double width, double breakaway, double h, int sub, int n, int every_step, double *out)
{
    plant of = {.p = p, .w = 0, .width = width, .breakaway = breakaway};
    double d[AT_LEAST_1(NX)], now[AT_LEAST_1(NU)];
    for (int i = 0; i < NS; i++)
        of.m[i] = modes[i];
    for (int k = 0; k < n; k++) {
        of.w = w ? w + k * N : 0;
        for (int j = 0; j < sub; j++) {
            const double *u3 = smooth ? u + ((long)k * sub + j) * 3 * NU : u + (long)k * NU;
            inputs_at(u3, smooth, 0.0, now);
            if (fresh && k == 0 && j == 0)
                begin(&of, x, now);
            if (j == 0 || every_step) {
                memcpy(out, x, sizeof(double) * NX);
                field(&of, x, now, d, out + NX);
                out += NX + N;
            }
            advance(&of, x, u3, smooth, h);
        }
    }
    for (int i = 0; i < NS; i++)
        modes[i] = of.m[i];
    return of.fault;
}
