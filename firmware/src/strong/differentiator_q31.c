#include "pvid/differentiator_q31.h"

#include <stddef.h>

#include "strong/fir_window.h"
#include "number/init.h"
#include "number/integer_q31.h"

enum { PHI = 0, Y = 1 };

const PVID_TABLE int32_t pvid_five_points_q31[PVID_ORDERS * 2] = {
    0,   0,  /* order 0: the centre itself */
    8,   -1, /* order 1 */
    16,  -1, /* order 2 */
    -12, 6,  /* order 3 */
    -48, 12, /* order 4 */
};

static bool is_even(size_t order)
{
    return (order % 2u) == 0u;
}

/* Largest factor of a weight of each order: q = (x - c) + (x' - c), d = x - x'. */
static uint64_t derivative_range(size_t order, int32_t full_scale)
{
    return (uint64_t)full_scale * (is_even(order) ? 4u : 2u);
}

/* Every product fits 32 bits. Sums of 8191 of them fit 64. */
static bool products_fit(const pvid_fir_bank_q31 *bank, size_t order, int32_t full_scale)
{
    const PVID_TABLE int32_t *weight = &bank->weights[order * bank->half];
    const uint64_t range = derivative_range(order, full_scale);
    for (size_t i = 0; i < bank->half; i++) {
        if ((pvid_magnitude_q31(weight[i]) * range) > (uint64_t)INT32_MAX) {
            return false;
        }
    }
    return true;
}

/* The largest sum that counts within full scale can make, each with the sign of its weight, stays within the limit. */
static bool sum_fits(const pvid_fir_bank_q31 *bank, size_t order, int32_t full_scale, uint8_t shift)
{
    const PVID_TABLE int32_t *weight = &bank->weights[order * bank->half];
    uint64_t away = 0;
    int64_t at_centre = (order == 0u) ? bank->centre : 0;
    for (size_t i = 0; i < bank->half; i++) {
        away += 2u * pvid_magnitude_q31(weight[i]);
        at_centre -= is_even(order) ? (2 * (int64_t)weight[i]) : 0;
    }
    const uint64_t largest = (away + pvid_magnitude_q31(at_centre)) * (uint64_t)full_scale;
    return (shift <= 62u) && (pvid_round_shift_q31((int64_t)largest, shift) <= PVID_DERIVATIVE_LIMIT_Q31);
}

static bool is_full_scale(int32_t counts)
{
    return (counts >= 1) && (counts <= PVID_COUNTS_LIMIT_Q31);
}

/* The derivatives of one signal from `lowest` on. */
static pvid_status channel_is_valid(const pvid_fir_bank_q31 *bank, size_t lowest, int32_t full_scale,
                                    const uint8_t shift[])
{
    for (size_t k = lowest; k < PVID_ORDERS; k++) {
        if (!products_fit(bank, k, full_scale)) {
            return PVID_BAD_FULL_SCALE;
        }
        if (!sum_fits(bank, k, full_scale, shift[k - lowest])) {
            return PVID_BAD_SHIFT;
        }
    }
    return PVID_OK;
}

static pvid_status bank_is_valid(const pvid_fir_bank_q31 *bank)
{
    const pvid_status window = pvid_fir_window(bank->half, bank->stride);
    if (window != PVID_OK) {
        return window;
    }
    if (bank->weights == NULL) {
        return PVID_BAD_BANK;
    }
    if ((bank->centre < 1) || (bank->centre > PVID_ONE_Q30)) {
        return PVID_BAD_CENTRE;
    }
    if (!is_full_scale(bank->phi_max) || !is_full_scale(bank->y_max)) {
        return PVID_BAD_FULL_SCALE;
    }
    const pvid_status phi = channel_is_valid(bank, 0, bank->phi_max, bank->phi_shift);
    return (phi != PVID_OK) ? phi : channel_is_valid(bank, PVID_Y_LOWEST_Q31, bank->y_max, bank->y_shift);
}

static pvid_status prepare(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank)
{
    const pvid_status status = bank_is_valid(bank);
    if (status != PVID_OK) {
        return status;
    }
    self->bank = *bank;
    self->length = (uint16_t)((2u * bank->half * bank->stride) + 1u);
    pvid_differentiator_reset_q31(self);
    return PVID_OK;
}

pvid_status pvid_differentiator_init_q31(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank)
{
    const pvid_status status = pvid_init_is_given(self, bank) ? prepare(self, bank) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_differentiator_reset_q31(pvid_differentiator_q31 *self)
{
    self->head = 0;
    self->filled = 0;
    for (size_t i = 0; i < self->length; i++) {
        self->history[i][PHI] = 0;
        self->history[i][Y] = 0;
    }
}

static int32_t rounded(int64_t sum, uint8_t shift)
{
    return (int32_t)pvid_round_shift_q31(sum, shift);
}

bool pvid_differentiator_step_q31(pvid_differentiator_q31 *self, int32_t phi, int32_t y, int32_t d_phi[PVID_ORDERS],
                                  int32_t d_y[PVID_Y_ORDERS_Q31])
{
    const bool ready = self->bank.weights != NULL;
    PVID_ASSERT(ready);
    if (!ready) {
        return false;
    }
    const size_t length = self->length;
    const size_t half = self->bank.half;
    const size_t stride = self->bank.stride;
    self->history[self->head][PHI] = phi;
    self->history[self->head][Y] = y;
    self->head = (uint16_t)((self->head + 1u == length) ? 0u : (self->head + 1u));
    if (self->filled < length) {
        self->filled++;
        if (self->filled < length) {
            return false;
        }
    }
    /* head is now the oldest sample; the centre is half * stride after it */
    const size_t after_oldest = self->head + (half * stride);
    size_t newer = (after_oldest >= length) ? (after_oldest - length) : after_oldest;
    size_t older = newer;
    const int32_t middle_phi = self->history[newer][PHI];
    const int32_t middle_y = self->history[newer][Y];
    const PVID_TABLE int32_t *weight = self->bank.weights;
    int64_t phi0 = (int64_t)middle_phi * self->bank.centre;
    int64_t phi1 = 0;
    int64_t phi2 = 0;
    int64_t phi3 = 0;
    int64_t phi4 = 0;
    int64_t y2 = 0;
    int64_t y3 = 0;
    int64_t y4 = 0;
    for (size_t i = 0; i < half; i++) {
        newer += stride;
        newer = (newer >= length) ? (newer - length) : newer;
        older = (older < stride) ? ((older + length) - stride) : (older - stride);
        const int32_t *after = self->history[newer];
        const int32_t *before = self->history[older];
        const int32_t even_phi = (after[PHI] + before[PHI]) - (2 * middle_phi);
        const int32_t odd_phi = after[PHI] - before[PHI];
        const int32_t even_y = (after[Y] + before[Y]) - (2 * middle_y);
        const int32_t odd_y = after[Y] - before[Y];
        const int32_t weight2 = weight[2u * half];
        const int32_t weight3 = weight[3u * half];
        const int32_t weight4 = weight[4u * half];
        phi0 += weight[0] * even_phi;
        phi1 += weight[half] * odd_phi;
        phi2 += weight2 * even_phi;
        phi3 += weight3 * odd_phi;
        phi4 += weight4 * even_phi;
        y2 += weight2 * even_y;
        y3 += weight3 * odd_y;
        y4 += weight4 * even_y;
        weight++;
    }
    const uint8_t *shift = self->bank.phi_shift;
    d_phi[0] = rounded(phi0, shift[0]);
    d_phi[1] = rounded(phi1, shift[1]);
    d_phi[2] = rounded(phi2, shift[2]);
    d_phi[3] = rounded(phi3, shift[3]);
    d_phi[4] = rounded(phi4, shift[4]);
    d_y[0] = rounded(y2, self->bank.y_shift[0]);
    d_y[1] = rounded(y3, self->bank.y_shift[1]);
    d_y[2] = rounded(y4, self->bank.y_shift[2]);
    return true;
}
