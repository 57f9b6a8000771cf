/* A row of the strong form in integers, and its innovation. */
#include "kapitza_integer_q31.h"

#include <string.h>

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

#define PART_LIMIT ((int32_t)1 << 30)

/* x 2^shift as an entry of a row. */
static inline int32_t shifted_entry(int32_t x, int32_t shift, bool *fits)
{
    if (shift <= 0) {
        return pvid_within_q31(pvid_round_shift_q31(x, (uint32_t)-shift), PVID_ROW_LIMIT_Q31, fits);
    }
    const uint32_t up = (shift < 31) ? (uint32_t)shift : 31u;
    return pvid_within_q31(x * ((int64_t)1 << up), PVID_ROW_LIMIT_Q31, fits);
}

static inline int32_t entry(int64_t x, bool *fits)
{
    return pvid_within_q31(x, PVID_ROW_LIMIT_Q31, fits);
}

/* out[count - 1], .., out[0] = -x, -G x, -G^2 x .. */
static inline void powers(int32_t x, int32_t g, size_t count, int32_t out[], bool *fits)
{
    out[count - 1u] = -x;
    for (size_t k = count - 1u; k > 0u; k--) {
        out[k - 1u] = entry(pvid_by_rate_q31(out[k], g), fits);
    }
}

bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *format, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t row[PVID_KAPITZA_ROW_Q31])
{
    bool fits = true;
    const int32_t phi0 = shifted_entry(phi[0], format->phi_shift[0], &fits);
    const int32_t phi2 = shifted_entry(phi[2], format->phi_shift[2], &fits);
    const int32_t third =
        pvid_within_q31(pvid_nearest_q31(pvid_product_q31(phi[3], format->phi3), 30), PART_LIMIT, &fits);
    const int32_t phi3 = shifted_entry(third, format->phi_shift[3], &fits);
    const int32_t phi4 = shifted_entry(phi[4], format->phi_shift[4], &fits);
    const int32_t x = shifted_entry(phi[2], format->phi_shift[2] + format->finer[0], &fits);
    const int32_t g = u[0] + format->reference;
    /* Y = 2 u' (u' phi'') - G (u'' phi'' + 2 u' phi''' - G phi''''), and N_1 is that bracket less G phi'''' */
    const int64_t g_phi4 = pvid_short_product_q31(g, phi4);
    const int64_t bracket = (pvid_short_product_q31(u[2], phi2) + (2 * pvid_short_product_q31(u[1], phi3))) - g_phi4;
    const int32_t part = pvid_within_q31(pvid_nearest_q31(bracket, PVID_KAPITZA_RATE_BITS), PART_LIMIT, &fits);
    const int32_t u1_phi2 = pvid_within_q31(pvid_by_rate_q31(phi2, u[1]), PART_LIMIT, &fits);
    const int64_t y = (2 * pvid_short_product_q31(u[1], u1_phi2)) - pvid_short_product_q31(g, part);
    row[PVID_ROW_A] = entry(pvid_nearest_q31(bracket - g_phi4, PVID_KAPITZA_RATE_BITS), &fits);
    row[PVID_ROW_E] = -phi4;
    powers(x, g, 4, &row[PVID_ROW_X], &fits);
    powers(phi0, g, 5, &row[PVID_ROW_Z], &fits);
    row[PVID_ROW_Y] = entry(pvid_nearest_q31(y, PVID_KAPITZA_RATE_BITS), &fits);
    row[PVID_KAPITZA_ROW_G] = g;
    return fits;
}

/* A product with d, the parameter a, without the bits of its format. */
static inline int64_t term(const pvid_kapitza_estimator_q31 *self, size_t a, int64_t product)
{
    return pvid_round_shift_q31(product, (uint32_t)self->bits[a - 1u]);
}

bool pvid_kapitza_estimator_innovate_q31(const pvid_kapitza_estimator_q31 *self,
                                         const int32_t row[PVID_KAPITZA_ROW_Q31], int32_t *e,
                                         int32_t gradient[PVID_KAPITZA_P])
{
    bool fits = true;
    const int32_t beyond = (int32_t)pvid_nearest_q31((int64_t)self->p[W] - self->reference, 1); /* w - w_r */
    const int32_t g = pvid_within_q31((int64_t)row[PVID_KAPITZA_ROW_G] + beyond, PART_LIMIT, &fits);
    const int32_t g1_x = entry(pvid_by_rate_q31(row[PVID_ROW_X + 3], g), &fits);
    const int32_t g2_x = entry(pvid_by_rate_q31(g1_x, g), &fits);
    const int32_t g3_x = entry(pvid_by_rate_q31(g2_x, g), &fits);
    const int32_t g1_z = entry(pvid_by_rate_q31(row[PVID_ROW_Z + 4], g), &fits);
    const int32_t g2_z = entry(pvid_by_rate_q31(g1_z, g), &fits);
    const int32_t g3_z = entry(pvid_by_rate_q31(g2_z, g), &fits);
    const int32_t g4_z = entry(pvid_by_rate_q31(g3_z, g), &fits);
    const int64_t of_e = pvid_by_rate_q31(row[PVID_ROW_E], beyond);
    const int32_t inner = pvid_within_q31(row[PVID_ROW_A] + of_e, PART_LIMIT, &fits);
    const int64_t d1_g2_x = pvid_product_q31(self->p[D1], g2_x);
    const int64_t known = pvid_by_rate_q31(inner, beyond) + term(self, D1, pvid_product_q31(self->p[D1], g3_x)) +
                          term(self, D2, pvid_product_q31(self->p[D2], g4_z));
    const int64_t slope = (inner + of_e) + term(self, D1, d1_g2_x + (2 * d1_g2_x)) +
                          term(self, D2, 4 * pvid_product_q31(self->p[D2], g3_z));
    gradient[W] = pvid_within_q31(slope, PART_LIMIT, &fits);
    gradient[D1] = g3_x;
    gradient[D2] = g4_z;
    *e = entry(row[PVID_ROW_Y] - known, &fits);
    return fits;
}
