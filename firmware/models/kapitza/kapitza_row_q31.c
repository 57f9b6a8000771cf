/* A row of the strong form in integers, and its innovation. */
#include "kapitza_integer_q31.h"

#include "number/unroll.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

#define ENTRY_BITS 28 /* of an entry of a row beside its sign */
#define PART_BITS 30  /* of what entries are made of */
#define TERM_BITS 29  /* of a term of N^T theta and of its slope */

/* x 2^-24 rounded half up; whether it is within -2^bits..2^bits - 1. |x| < 2^62. */
PVID_ALWAYS_INLINE bool of_rates(int64_t x, uint32_t bits, int32_t *out)
{
    const int64_t above = x + ((int64_t)1 << (PVID_KAPITZA_RATE_BITS - 1));
    const int32_t high = (int32_t)pvid_floor_shift_q31(above, 32);
    const int32_t limit = (int32_t)((uint32_t)1 << (bits - (32u - PVID_KAPITZA_RATE_BITS)));
    const uint32_t low = (uint32_t)((uint64_t)above & 0xFFFFFFFFu);
    if ((high >= limit) || (high < -limit)) {
        return false;
    }
    *out = (high * 256) + (int32_t)(low >> PVID_KAPITZA_RATE_BITS);
    return true;
}

/* a b with b a rate, both within 2^30, as an entry. */
PVID_ALWAYS_INLINE bool by_rate(int32_t a, int32_t b, int32_t *out)
{
    return of_rates(pvid_short_product_q31(a, b), ENTRY_BITS, out);
}

/* x 2^shift as an entry, |shift| <= 62. */
static inline bool shifted_entry(int32_t x, int32_t shift, int32_t *out)
{
    if (shift > ENTRY_BITS) {
        *out = 0;
        return x == 0;
    }
    if (shift <= 0) {
        const int32_t down = pvid_moved_q31(x, shift);
        if ((down >= PVID_ROW_LIMIT_Q31) || (down < -PVID_ROW_LIMIT_Q31)) {
            return false;
        }
        *out = down;
        return true;
    }
    const int64_t y = x * ((int64_t)1 << (uint32_t)shift);
    if ((y >= PVID_ROW_LIMIT_Q31) || (y < -PVID_ROW_LIMIT_Q31)) {
        return false;
    }
    *out = (int32_t)y;
    return true;
}

/* out[2], out[1], out[0] = G out[3], G^2 out[3], G^3 out[3]. */
static bool three_powers(int32_t g, int32_t out[])
{
    return by_rate(out[3], g, &out[2]) && by_rate(out[2], g, &out[1]) && by_rate(out[1], g, &out[0]);
}

/* out[3], .., out[0] = x, G x, G^2 x, G^3 x. */
static inline bool powers_to_3(int32_t x, int32_t g, int32_t out[])
{
    out[3] = x;
    return three_powers(g, out);
}

/* out[4], .., out[0] = x, G x, .., G^4 x. */
static inline bool powers_to_4(int32_t x, int32_t g, int32_t out[])
{
    out[4] = x;
    return by_rate(x, g, &out[3]) && three_powers(g, out);
}

/* The derivatives of phi in their units. */
typedef struct {
    int32_t phi0;
    int32_t phi2;
    int32_t phi3;
    int32_t phi4;
    int32_t x; /* phi'' in the unit of -G^k phi'' */
} angles;

static bool take_angles(const pvid_strong_row_q31 *format, const int32_t phi[PVID_ORDERS], angles *out)
{
    const int64_t third = pvid_nearest_q31(pvid_product_q31(phi[3], format->phi3), 30);
    if ((third >= PVID_ONE_Q30) || (third < -PVID_ONE_Q30)) {
        return false;
    }
    return shifted_entry(phi[0], format->phi_shift[0], &out->phi0) &&
           shifted_entry(phi[2], format->phi_shift[2], &out->phi2) &&
           shifted_entry((int32_t)third, format->phi_shift[3], &out->phi3) &&
           shifted_entry(phi[4], format->phi_shift[4], &out->phi4) &&
           shifted_entry(phi[2], (int32_t)format->phi_shift[2] + format->finer[0], &out->x);
}

bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *format, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t row[PVID_KAPITZA_ROW_Q31])
{
    angles of = {0, 0, 0, 0, 0};
    if (!take_angles(format, phi, &of)) {
        return false;
    }
    const int32_t g = u[0] + format->reference;
    /* Y = 2 u' (u' phi2) - G (u'' phi2 + 2 u' phi3 - G phi4), and N_1 is that bracket less G phi4 */
    const int64_t g_phi4 = pvid_short_product_q31(g, of.phi4);
    const int64_t bracket =
        (pvid_short_product_q31(u[2], of.phi2) + (2 * pvid_short_product_q31(u[1], of.phi3))) - g_phi4;
    int32_t part;
    int32_t u1_phi2;
    if (!of_rates(bracket, PART_BITS, &part) || !of_rates(pvid_short_product_q31(of.phi2, u[1]), PART_BITS, &u1_phi2) ||
        !of_rates(bracket - g_phi4, ENTRY_BITS, &row[PVID_ROW_A])) {
        return false;
    }
    const int64_t y = (2 * pvid_short_product_q31(u[1], u1_phi2)) - pvid_short_product_q31(g, part);
    row[PVID_ROW_E] = -of.phi4;
    row[PVID_KAPITZA_ROW_G] = g;
    return of_rates(y, ENTRY_BITS, &row[PVID_ROW_Y]) && powers_to_3(-of.x, g, &row[PVID_ROW_X]) &&
           powers_to_4(-of.phi0, g, &row[PVID_ROW_Z]);
}

/* A product with d, the parameter a, without the bits of its format; whether it is within -2^29..2^29 - 1. */
static inline bool term(const pvid_kapitza_estimator_q31 *self, size_t a, int64_t product, int32_t *out)
{
    return pvid_narrows_q31(product, (uint32_t)self->bits[a - 1u], TERM_BITS, out);
}

bool pvid_kapitza_estimator_innovate_q31(const pvid_kapitza_estimator_q31 *self,
                                         const int32_t row[PVID_KAPITZA_ROW_Q31], int32_t *e,
                                         int32_t gradient[PVID_KAPITZA_P])
{
    const int32_t beyond = (int32_t)pvid_nearest_q31((int64_t)self->p[W] - self->reference, 1); /* w - w_r */
    const int64_t rate = (int64_t)row[PVID_KAPITZA_ROW_G] + beyond;
    if ((rate >= PVID_ONE_Q30) || (rate < -PVID_ONE_Q30)) {
        return false;
    }
    const int32_t g = (int32_t)rate;
    int32_t g_x[4];
    int32_t g_z[5];
    int32_t of_e;
    if (!powers_to_3(row[PVID_ROW_X + 3], g, g_x) || !powers_to_4(row[PVID_ROW_Z + 4], g, g_z) ||
        !of_rates(pvid_short_product_q31(row[PVID_ROW_E], beyond), TERM_BITS, &of_e)) {
        return false;
    }
    const int32_t inner = row[PVID_ROW_A] + of_e;
    const int64_t d1_g2_x = pvid_product_q31(self->p[D1], g_x[1]);
    int32_t of_w;
    int32_t of_d1 = 0;
    int32_t of_d2 = 0;
    int32_t slope_d1 = 0;
    int32_t slope_d2 = 0;
    if (!of_rates(pvid_short_product_q31(inner, beyond), TERM_BITS, &of_w) ||
        !term(self, D1, pvid_product_q31(self->p[D1], g_x[0]), &of_d1) ||
        !term(self, D2, pvid_product_q31(self->p[D2], g_z[0]), &of_d2) ||
        !term(self, D1, d1_g2_x + (2 * d1_g2_x), &slope_d1) ||
        !term(self, D2, 4 * pvid_product_q31(self->p[D2], g_z[1]), &slope_d2)) {
        return false;
    }
    const int32_t rest = row[PVID_ROW_Y] - (of_w + of_d1 + of_d2);
    const int64_t slope = ((int64_t)inner + of_e) + slope_d1 + slope_d2;
    if ((rest >= PVID_ROW_LIMIT_Q31) || (rest < -PVID_ROW_LIMIT_Q31) || (slope >= PVID_ONE_Q30) ||
        (slope < -PVID_ONE_Q30)) {
        return false;
    }
    gradient[W] = (int32_t)slope;
    gradient[D1] = g_x[0];
    gradient[D2] = g_z[0];
    *e = rest;
    return true;
}
