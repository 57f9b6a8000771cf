#include "weak/window_q31.h"

#include <string.h>

#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"

enum { UF = 0, F = 1, U = 2 }; /* integrands */

/* Terms by the table that multiplies them: those without a shift, those of chi'', of chi, the one of chi''''. */
#define ON_CHI2_HIGH 2u
#define ON_CHI2 8u
#define ON_CHI0 4u

/* The double integrals in units of dt^2/12, in which they are exact integers. */
static void integrate(pvid_weak_window_q31 *self, const int64_t now[], const uint8_t shift[], int64_t integral[])
{
    const bool first = self->index == 0u;
    for (size_t i = 0; i < PVID_WEAK_INTEGRALS_Q31; i++) {
        const int64_t once = self->once[i] + self->before[i] + now[i];
        const int64_t twice = self->twice[i] + self->once[i] + once;
        self->once[i] = first ? 0 : once;
        self->twice[i] = first ? 0 : twice;
        self->before[i] = now[i];
        integral[i] = pvid_round_shift_q31((3 * self->twice[i]) - (2 * now[i]), shift[i]);
    }
}

/* x - 2^shift pvid_round_shift_q31(x, shift): at most half of 2^shift. */
static int64_t rest_of(int64_t x, uint8_t shift)
{
    const int64_t half = ((int64_t)1 << shift) / 2;
    const int64_t raised = x + half;
    const uint64_t below = (uint64_t)raised & (((uint64_t)1 << shift) - 1u);
    return (int64_t)below - half;
}

/* product 2^-shift. */
static int32_t shifted(int64_t product, uint8_t shift)
{
    return (int32_t)pvid_round_shift_q31(product, shift);
}

void pvid_weak_window_terms_q31(pvid_weak_window_q31 *self, const pvid_weak_design_q31 *design, int32_t f, int32_t u,
                                const pvid_weak_curvature_q31 *curvature, int32_t term[PVID_WEAK_TERMS_Q31])
{
    const int64_t now[PVID_WEAK_INTEGRALS_Q31] = {(int64_t)u * f, f, u};
    int64_t integral[PVID_WEAK_INTEGRALS_Q31];
    integrate(self, now, design->integral_shift, integral);
    const bool first = self->index == 0u;
    self->f_sum = (first ? 0 : self->f_sum) + f;
    self->u_sum = (first ? 0 : self->u_sum) + u;
    self->u_square_sum = (first ? 0 : self->u_square_sum) + ((int64_t)u * u);
    self->curvature_square_sum = (first ? 0 : self->curvature_square_sum) + (curvature->due ? curvature->square : 0);
    self->curvatures = (uint16_t)((first ? 0u : self->curvatures) + (curvature->due ? 1u : 0u));
    const int64_t steps = self->index;
    const uint8_t *shift = design->product_shift;
    for (size_t i = 0; i < ON_CHI2_HIGH; i++) { /* i: U F, F */
        const int64_t product = -(u * integral[i]);
        const int64_t high = pvid_round_shift_q31(product, design->high_shift[i]);
        term[PVID_TERM_UIUF_HIGH_Q31 + i] = (int32_t)high;
        term[PVID_TERM_UIUF_Q31 + i] = shifted(rest_of(product, design->high_shift[i]), shift[i]);
    }
    term[PVID_TERM_UF_Q31] = -shifted(now[UF], design->uf_shift);
    term[PVID_TERM_F_Q31] = -f;
    term[PVID_TERM_UIU_Q31] = shifted(u * integral[U], shift[2]);
    term[PVID_TERM_UI1_Q31] = shifted(u * ((6 * steps * steps) - 2), shift[3]);
    term[PVID_TERM_U_Q31] = u;
    term[PVID_TERM_UT_Q31] = shifted(u * (steps - (int64_t)((design->window - 1u) / 2u)), shift[4]);
    term[PVID_TERM_CHI_UF_Q31] = term[PVID_TERM_UF_Q31];
    term[PVID_TERM_CHI_F_Q31] = -f;
    term[PVID_TERM_CHI_U_Q31] = u;
    term[PVID_TERM_CHI_1_Q31] = PVID_TERM_ONE_Q31;
    term[PVID_TERM_Y_Q31] = f;
}

/* Without the window's last sample, which is the first of the next window. */
int64_t pvid_weak_window_drive_q31(const pvid_weak_window_q31 *self, uint16_t samples)
{
    return ((int64_t)(samples - 1u) * self->u_square_sum) - (self->u_sum * self->u_sum);
}

pvid_scaled_q31 pvid_weak_window_curvature_q31(const pvid_weak_window_q31 *self)
{
    const pvid_scaled_q31 none = {0, 0};
    if (self->curvatures == 0u) {
        return none;
    }
    return pvid_scaled_over_q31(pvid_scaled_of_q31(self->curvature_square_sum, 0),
                                pvid_scaled_of_q31(self->curvatures, 0));
}

/* The inner loop: a 32-bit product, a shift that rounds half up, an addition. */
static inline int32_t rounded(int32_t chi, int32_t term, int32_t half, uint32_t shift)
{
    return pvid_floor_shift_32_q31((chi * term) + half, shift);
}

static inline void add_function(const int32_t *restrict term, int32_t chi0, int32_t chi2, int32_t chi4, uint32_t shift,
                                int32_t *restrict sum)
{
    const int32_t half = (int32_t)1 << (shift - 1u);
    size_t i = 0;
    PVID_UNROLL
    for (; i < ON_CHI2_HIGH; i++) {
        sum[i] += chi2 * term[i];
    }
    PVID_UNROLL
    for (; i < ON_CHI2_HIGH + ON_CHI2; i++) {
        sum[i] += rounded(chi2, term[i], half, shift);
    }
    PVID_UNROLL
    for (; i < ON_CHI2_HIGH + ON_CHI2 + ON_CHI0; i++) {
        sum[i] += rounded(chi0, term[i], half, shift);
    }
    sum[PVID_TERM_Y_Q31] += rounded(chi4, term[PVID_TERM_Y_Q31], half, shift);
}

void pvid_weak_window_add_q31(const pvid_weak_window_q31 *self, const pvid_weak_design_q31 *design,
                              const int32_t term[PVID_WEAK_TERMS_Q31], size_t first, size_t last,
                              int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    const size_t functions = design->functions;
    const PVID_TABLE int16_t *chi = &design->chi[3u * functions * self->index];
    if (self->index == 0u) {
        memset(&sums[first], 0, (last - first) * sizeof sums[0]);
        return;
    }
    for (size_t k = first; k < last; k++) {
        add_function(term, chi[k], chi[functions + k], chi[(2u * functions) + k], design->sum_shift, sums[k]);
    }
}
