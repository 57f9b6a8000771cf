#include "pvid/kapitza_strong_q31.h"

#include <stddef.h>

#include "number/integer_q31.h"
#include "pvid/estimator_q31.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

/* Places in N and theta; the powers of u descend there, as in the paper. */
enum { N_A = 0, N_E = 1, N_PHI2 = 2, N_PHI0 = 6 };

/* ---- the row ---- */

/* *out = x 2^-shift; false if it exceeds the limit of a row. */
static bool round_entry(int64_t x, uint8_t shift, int32_t *out)
{
    const int64_t rounded = pvid_round_shift_q31(x, shift);
    if ((rounded > PVID_ROW_LIMIT_Q31) || (rounded < -PVID_ROW_LIMIT_Q31)) {
        *out = (rounded > 0) ? PVID_ROW_LIMIT_Q31 : -PVID_ROW_LIMIT_Q31;
        return false;
    }
    *out = (int32_t)rounded;
    return true;
}

/* out[count - 1], .., out[0] = -x, -u x, -u^2 x .. */
static bool row_powers(int32_t x, int32_t u, const uint8_t shift[], size_t count, int32_t out[])
{
    bool fits = round_entry(-(int64_t)x, shift[0], &out[count - 1u]);
    for (size_t k = 1; k < count; k++) {
        const size_t at = (count - 1u) - k;
        fits = round_entry(pvid_product_q31(u, out[at + 1u]), shift[k], &out[at]) && fits;
    }
    return fits;
}

bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *shifts, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t *y, int32_t n[PVID_KAPITZA_STRONG_THETA])
{
    /* Y = 2 u' (u' phi'') - u (u'' phi'' + 2 u' phi''' - u phi''''), and N_1 is that bracket less u phi'''' */
    const int64_t u0_phi4 = pvid_product_q31(u[0], phi[4]);
    const int64_t bracket = (pvid_product_q31(u[2], phi[2]) + (2 * pvid_product_q31(u[1], phi[3]))) - u0_phi4;
    int32_t a;
    int32_t b;
    if (!round_entry(bracket, shifts->part, &a) || !round_entry(pvid_product_q31(u[1], phi[2]), shifts->part, &b) ||
        !round_entry((2 * pvid_product_q31(u[1], b)) - pvid_product_q31(u[0], a), shifts->y, y) ||
        !round_entry(bracket - u0_phi4, shifts->n_a, &n[N_A]) || !round_entry(-(int64_t)phi[4], shifts->n_e, &n[N_E])) {
        return false;
    }
    return row_powers(phi[2], u[0], shifts->n_phi2, 4, &n[N_PHI2]) &&
           row_powers(phi[0], u[0], shifts->n_phi0, 5, &n[N_PHI0]);
}

/* sum k term[k], k < count: each is added as often as there is one above it. */
static int64_t by_power(const int64_t term[], size_t count)
{
    int64_t above = 0;
    int64_t sum = 0;
    for (size_t k = count - 1u; k > 0u; k--) {
        above += term[k];
        sum += above;
    }
    return sum;
}

int64_t pvid_kapitza_strong_sensitivity_q31(const int64_t term[PVID_KAPITZA_STRONG_THETA])
{
    const int64_t alone = term[N_A] + (2 * term[N_E]);
    return alone + by_power(&term[N_PHI2], 4) + by_power(&term[N_PHI0], 5);
}

/* ---- theta and C ---- */

/* p has 31 bits: a single factor is shifted up to 58 bits, a product of two down to 58; a third factor shifts by
 * 31. Factors 2 and 4 are in the format, 3 is in the integer. */
#define UP 27
#define DOWN 4
#define ONE_BITS (30 + UP)

static int64_t scale_up(int64_t x)
{
    return x * ((int64_t)1 << UP);
}

static int64_t product(int32_t a, int32_t b)
{
    return pvid_round_shift_q31(pvid_product_q31(a, b), DOWN);
}

/* powers[k] = x w^k for k = 1..count, from the first. */
static void extend_powers(int64_t powers[], size_t count, int32_t w)
{
    for (size_t k = 1; k < count; k++) {
        powers[k] = pvid_times_q31(powers[k - 1u], w);
    }
}

static void theta_of(const int32_t p[], int64_t theta[])
{
    int64_t d1[3];
    int64_t *d2 = &theta[7];
    d1[0] = product(p[D1], p[W]);
    extend_powers(d1, 3, p[W]);
    d2[0] = product(p[D2], p[W]);
    extend_powers(d2, 4, p[W]);
    theta[0] = scale_up(p[W]);
    theta[1] = product(p[W], p[W]);
    theta[2] = scale_up(p[D1]);
    theta[3] = 3 * d1[0];
    theta[4] = 3 * d1[1];
    theta[5] = d1[2];
    theta[6] = scale_up(p[D2]);
    theta[8] *= 3;
}

static const uint8_t c_row[18] = {0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10};
static const uint8_t c_column[18] = {W, W, W, W, W, W, W, W, W, D1, D1, D1, D1, D2, D2, D2, D2, D2};

static void jacobian_of(const int32_t p[], int64_t c[])
{
    int64_t d1[2];
    int64_t d2[3];
    int64_t *w = &c[15]; /* w^2, w^3, w^4 */
    d1[0] = product(p[D1], p[W]);
    extend_powers(d1, 2, p[W]);
    d2[0] = product(p[D2], p[W]);
    extend_powers(d2, 3, p[W]);
    w[0] = product(p[W], p[W]);
    extend_powers(w, 3, p[W]);
    const int64_t one = (int64_t)1 << ONE_BITS;
    const int64_t first = scale_up(p[W]);
    c[0] = one;
    c[1] = first;
    c[2] = 3 * scale_up(p[D1]);
    c[3] = 3 * d1[0];
    c[4] = 3 * d1[1];
    c[5] = scale_up(p[D2]);
    c[6] = 3 * d2[0];
    c[7] = 3 * d2[1];
    c[8] = d2[2];
    c[9] = one;
    c[10] = 3 * first;
    c[11] = 3 * w[0];
    c[12] = w[1];
    c[13] = one;
    c[14] = first;
    w[0] *= 3;
}

static void formats_of(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    const int16_t w1 = (int16_t)(p_bits[W] + UP);
    const int16_t down = (int16_t)(p_bits[W] - 31); /* a factor w more */
    const int16_t w2 = (int16_t)((2 * p_bits[W]) - DOWN);
    const int16_t d1 = (int16_t)(p_bits[D1] + UP);
    const int16_t d1_w = (int16_t)((p_bits[D1] + p_bits[W]) - DOWN);
    const int16_t d2 = (int16_t)(p_bits[D2] + UP);
    const int16_t d2_w = (int16_t)((p_bits[D2] + p_bits[W]) - DOWN);
    const int16_t theta[PVID_KAPITZA_STRONG_THETA] = {
        w1,                                 /* w */
        w2,                                 /* w^2 */
        d1,                                 /* d1 */
        d1_w,                               /* 3 d1 w */
        (int16_t)(d1_w + down),             /* 3 d1 w^2 */
        (int16_t)(d1_w + (2 * down)),       /* d1 w^3 */
        d2,                                 /* d2 */
        (int16_t)(d2_w - 2),                /* 4 d2 w */
        (int16_t)((d2_w + down) - 1),       /* 2 3 d2 w^2 */
        (int16_t)((d2_w + (2 * down)) - 2), /* 4 d2 w^3 */
        (int16_t)(d2_w + (3 * down)),       /* d2 w^4 */
    };
    const int16_t c[18] = {
        ONE_BITS,                           /* 1 */
        (int16_t)(w1 - 1),                  /* 2 w */
        d1,                                 /* 3 d1 */
        (int16_t)(d1_w - 1),                /* 2 3 d1 w */
        (int16_t)(d1_w + down),             /* 3 d1 w^2 */
        (int16_t)(d2 - 2),                  /* 4 d2 */
        (int16_t)(d2_w - 2),                /* 4 3 d2 w */
        (int16_t)((d2_w + down) - 2),       /* 4 3 d2 w^2 */
        (int16_t)((d2_w + (2 * down)) - 2), /* 4 d2 w^3 */
        ONE_BITS,                           /* 1 */
        w1,                                 /* 3 w */
        w2,                                 /* 3 w^2 */
        (int16_t)(w2 + down),               /* w^3 */
        ONE_BITS,                           /* 1 */
        (int16_t)(w1 - 2),                  /* 4 w */
        (int16_t)(w2 - 1),                  /* 2 3 w^2 */
        (int16_t)((w2 + down) - 2),         /* 4 w^3 */
        (int16_t)(w2 + (2 * down)),         /* w^4 */
    };
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        theta_bits[i] = theta[i];
    }
    for (size_t k = 0; k < 18u; k++) {
        c_bits[k] = c[k];
    }
}

const pvid_model_q31 pvid_kapitza_strong_q31 = {
    .n_theta = PVID_KAPITZA_STRONG_THETA,
    .n_p = PVID_KAPITZA_P,
    .n_c = 18,
    .positive = 7u,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
    .formats = formats_of,
};
