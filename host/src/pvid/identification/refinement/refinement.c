/* Blocks of a run under the equations of a model, with their derivatives by each block's start and by r: RK4.
 *
 * Before this text: N, ORDER, NU, NZ, NM, NT, SKEW, NS, WIDTHS (place in r) and pvid_refine_ constants, motion,
 * jacobian, output, output_jacobian. Derivatives are those of the steps as they are computed, so that a search by them
 * converges to rounding. */
#define NX (ORDER * N)
#define NC (NX + NM + SKEW) /* columns that are integrated */
#define NW (NC + NT)        /* and those of the outputs alone */

/* dx/dt and dS/dt, S [NX][NC], of the first `columns` columns: NX of them, or all */
static void rates(const double *m, const double *x, const double *u, const double *du, const double *s, double *f,
                  double *ds, int columns)
{
    double a[N];
    if (!ds) {
        pvid_refine_motion(m, x, x + N, u, a);
    } else {
        double K[N * N], D[N * N], U[N * NU + 1], B[NM * N + 1];
#if ORDER == 2
        pvid_refine_jacobian(m, x, x + N, u, a, K, D, U, B);
#else
        pvid_refine_jacobian(m, x, x, u, a, K, U, B);
        (void)D;
#endif
        for (int i = 0; i < N; i++) {
            double *row = ds + (NX - N + i) * NC;
            for (int c = 0; c < columns; c++) {
                double sum = 0;
                for (int j = 0; j < N; j++) {
                    sum += K[i * N + j] * s[j * NC + c];
#if ORDER == 2
                    sum += D[i * N + j] * s[(N + j) * NC + c];
#endif
                }
                row[c] = sum;
            }
            for (int k = 0; k < NM && columns > NX; k++)
                row[NX + k] += B[k * N + i];
#if SKEW
            for (int k = 0; k < NU && columns > NX; k++)
                row[NX + NM] += U[i * NU + k] * du[k];
#endif
#if ORDER == 2
            for (int c = 0; c < columns; c++)
                ds[i * NC + c] = s[(N + i) * NC + c];
#endif
        }
    }
    for (int i = 0; i < N; i++) {
#if ORDER == 2
        f[i] = x[N + i];
#endif
        f[NX - N + i] = a[i];
    }
}

static void step(const double *m, double *x, double *s, const double *u, const double *du, double h, int columns)
{
    static const double along[3] = {0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
    static const int place[4] = {0, 1, 1, 2};
    double t[NX], f[NX], sum[NX], st[NX * NC], ds[NX * NC], ssum[NX * NC];
    for (int i = 0; i < NX; i++) {
        t[i] = x[i];
        sum[i] = 0;
    }
    if (columns)
        for (int i = 0; i < NX; i++)
            for (int c = i * NC; c < i * NC + columns; c++) {
                st[c] = s[c];
                ssum[c] = 0;
            }
    for (int stage = 0; stage < 4; stage++) {
        rates(m, t, u + place[stage] * NU, du + place[stage] * NU, st, f, columns ? ds : 0, columns);
        for (int i = 0; i < NX; i++) {
            sum[i] += weight[stage] * f[i];
            if (stage < 3)
                t[i] = x[i] + along[stage] * h * f[i];
        }
        if (columns)
            for (int i = 0; i < NX; i++)
                for (int c = i * NC; c < i * NC + columns; c++) {
                    ssum[c] += weight[stage] * ds[c];
                    if (stage < 3)
                        st[c] = s[c] + along[stage] * h * ds[c];
                }
    }
    for (int i = 0; i < NX; i++)
        x[i] += h * sum[i];
    if (columns)
        for (int i = 0; i < NX; i++)
            for (int c = i * NC; c < i * NC + columns; c++)
                s[c] += h * ssum[c];
}

static void read_out(const double *m, const double *x, const double *u, const double *s, double *z, double *J,
                     int starts_alone)
{
    pvid_refine_output(m, x, x + NX - N, u, z);
    if (!J)
        return;
    double Zq[NZ * N], Zr[NZ * (NM + NT) + 1];
#if ORDER == 2
    double Zv[NZ * N];
    pvid_refine_output_jacobian(m, x, x + N, u, Zq, Zv, Zr);
#else
    pvid_refine_output_jacobian(m, x, x, u, Zq, Zr);
#endif
    for (int o = 0; o < NZ; o++) {
        double *row = J + o * NW;
        for (int c = 0; c < (starts_alone ? NX : NC); c++) {
            double sum = 0;
            for (int j = 0; j < N; j++) {
                sum += Zq[o * N + j] * s[j * NC + c];
#if ORDER == 2
                sum += Zv[o * N + j] * s[(N + j) * NC + c];
#endif
            }
            row[c] = sum;
        }
        if (starts_alone)
            continue;
        for (int k = 0; k < NM; k++)
            row[NX + k] += Zr[o * (NM + NT) + k];
        for (int k = 0; k < NT; k++)
            row[NC + k] = Zr[o * (NM + NT) + NM + k];
    }
}

#if NS
/* Whether a friction may reverse within the next sample: its argument is near 0, beside its last change. */
static int is_near(const double *m, const double *r, const double *x, const double *u, double *before)
{
    double g[NS];
    int near = 0;
    pvid_refine_signs(m, x, x + NX - N, u, g);
    for (int i = 0; i < NS; i++) {
        near |= !(fabs(g[i]) > 2 * fabs(g[i] - before[i]) + 20 * r[WIDTHS + i]);
        before[i] = g[i];
    }
    return near;
}
#endif

/* u, du: at begin, middle and end of each step [steps][3][NU]; z [blocks][samples][NZ]; J [blocks][samples][NZ][NW] or
 * NULL; starts_alone: of J the first NX columns; ends [blocks][NX]; coarse: an even number of steps, or 1, that may be
 * taken as one */
void refine_blocks(const double *r, int blocks, const int *first, int samples, int sub, int coarse, double h,
                   const double *u, const double *du, const double *starts, double *z, double *J, int starts_alone,
                   double *ends)
{
    const int columns = starts_alone ? NX : NC;
    (void)coarse;
    double m[NUMBER_OF_CONSTANTS + 1];
    pvid_refine_constants(r, m);
    for (int b = 0; b < blocks; b++) {
        double x[NX], s[NX * NC];
        for (int i = 0; i < NX; i++)
            x[i] = starts[b * NX + i];
        for (int i = 0; i < NX * NC; i++)
            s[i] = i / NC == i % NC;
#if NS
        double before[NS];
        for (int i = 0; i < NS; i++)
            before[i] = 1e300;
#endif
        for (int k = 0; k < samples; k++) {
            const long at = ((long)first[b] + k) * sub;
            const long row = (long)b * samples + k;
            /* an output that jumps with a held input: before the jump it is that of the last step's end */
            const long read = (READ_BEFORE && at > 0) ? at * 3 - 1 : at * 3;
            read_out(m, x, u + read * NU, s, z + row * NZ, J ? J + row * NZ * NW : 0, starts_alone);
            int together = 1; /* steps: as many as `coarse` in one where no friction reverses */
#if NS
            if (!is_near(m, r, x, u + at * 3 * NU, before))
                together = coarse;
#endif
            for (int j = 0; j < sub; j += together) {
                double wide[2][3 * NU];
                const double *from[2] = {u + (at + j) * 3 * NU, du + (at + j) * 3 * NU};
                for (int i = 0; i < 2 && together > 1; i++) {
                    for (int n = 0; n < NU; n++) {
                        wide[i][n] = from[i][n];
                        wide[i][NU + n] = from[i][(together / 2) * 3 * NU + n];
                        wide[i][2 * NU + n] = from[i][(together - 1) * 3 * NU + 2 * NU + n];
                    }
                    from[i] = wide[i];
                }
                step(m, x, s, from[0], from[1], together * h, J ? columns : 0);
            }
        }
        for (int i = 0; i < NX; i++)
            ends[b * NX + i] = x[i];
    }
}

/* Readings of an output behind a play of +-half: each stands still until the sensor's motion has taken up the play. z
 * [blocks][samples][NZ]; J [blocks][samples][NZ][columns] or NULL, whose column `place` becomes the derivative by
 * `half` */
void refine_play(int blocks, int samples, int output, double half, double *z, double *J, int columns, int place)
{
    for (int b = 0; b < blocks; b++) {
        double held = 0;
        long from = -1; /* row at which the reading moved last */
        for (int k = 0; k < samples; k++) {
            const long row = ((long)b * samples + k) * NZ + output;
            const double up = z[row] - half, down = z[row] + half;
            int moves = up > held ? 1 : down < held ? -1 : 0;
            if (k == 0) /* the motion goes on as it begins */
                moves = samples > 1 && z[row + NZ] < z[row] ? -1 : 1;
            if (moves) {
                held = moves > 0 ? up : down;
                from = row;
                if (J)
                    J[row * columns + place] = -moves;
            } else if (J) {
                for (int c = 0; c < columns; c++)
                    J[row * columns + c] = J[from * columns + c];
            }
            z[row] = held;
        }
    }
}
