#include "pvid/differentiator_q31.h"

#include <stddef.h>
#include <string.h>

#include "strong/fir_window.h"
#include "number/init.h"
#include "number/integer_q31.h"
#include "number/unroll.h"

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

/* Samples of a point. */
static int32_t block_of(const pvid_fir_bank_q31 *bank)
{
    return (bank->block > 1u) ? (int32_t)bank->block : 1;
}

/* Largest factor of a weight of each order: q = (x - c) + (x' - c), d = x - x'. */
static uint64_t derivative_range(size_t order, int32_t full_scale)
{
    return (uint64_t)full_scale * (is_even(order) ? 4u : 2u);
}

/* Without a block every product fits 32 bits, and sums of 8191 of them fit 64; with one the sum fits 62. */
static bool products_fit(const pvid_fir_bank_q31 *bank, size_t order, int32_t full_scale)
{
    const PVID_TABLE int32_t *weight = &bank->weights[order * bank->half];
    const uint64_t range = derivative_range(order, full_scale);
    uint64_t sum = (order == 0u) ? (uint64_t)bank->centre : 0u;
    bool narrow = true;
    for (size_t i = 0; i < bank->half; i++) {
        const uint64_t size = pvid_magnitude_q31(weight[i]);
        narrow = narrow && ((size * range) <= (uint64_t)INT32_MAX);
        sum += size;
    }
    return (bank->block > 1u) ? (sum <= ((uint64_t)PVID_WIDE / range)) : narrow;
}

/* The largest sum that points within full scale can make, each with the sign of its weight, stays within the limit. */
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

static bool is_full_scale(int32_t counts, int32_t block)
{
    return (counts >= 1) && (counts <= (PVID_COUNTS_LIMIT_Q31 / block));
}

/* The derivatives of one signal from `lowest` on, whose points are within full scale. */
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
    const int32_t block = block_of(bank);
    if (!is_full_scale(bank->phi_max, block) || !is_full_scale(bank->y_max, block)) {
        return PVID_BAD_FULL_SCALE;
    }
    const pvid_status phi = channel_is_valid(bank, 0, bank->phi_max * block, bank->phi_shift);
    return (phi != PVID_OK) ? phi : channel_is_valid(bank, PVID_Y_LOWEST_Q31, bank->y_max * block, bank->y_shift);
}

/* Whether the bank has the weights of pvid_five_points_q31, wherever they are stored, and no shift. */
static bool is_five_points(const pvid_fir_bank_q31 *bank)
{
    bool equal = (bank->half == 2u) && (bank->block <= 1u) && (bank->centre == PVID_FIVE_POINTS_CENTRE_Q31);
    for (size_t i = 0; equal && (i < (size_t)PVID_ORDERS * 2u); i++) {
        equal = bank->weights[i] == pvid_five_points_q31[i];
    }
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        equal = equal && (bank->phi_shift[k] == 0u);
    }
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        equal = equal && (bank->y_shift[k] == 0u);
    }
    return equal;
}

/* One by one: the padding of a copied struct would be that of the caller's, and end in snapshots. */
static void take_bank(pvid_fir_bank_q31 *own, const pvid_fir_bank_q31 *bank)
{
    own->half = bank->half;
    own->stride = bank->stride;
    own->block = bank->block;
    own->phi_max = bank->phi_max;
    own->y_max = bank->y_max;
    own->centre = bank->centre;
    memcpy(own->phi_shift, bank->phi_shift, sizeof own->phi_shift);
    memcpy(own->y_shift, bank->y_shift, sizeof own->y_shift);
    own->weights = bank->weights;
}

static pvid_status prepare(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank)
{
    const pvid_status status = bank_is_valid(bank);
    if (status != PVID_OK) {
        return status;
    }
    take_bank(&self->bank, bank);
    self->length = (uint16_t)((2u * bank->half * bank->stride) + 1u);
    self->five_points = is_five_points(bank);
    pvid_differentiator_reset_q31(self);
    return PVID_OK;
}

PVID_COLD pvid_status pvid_differentiator_init_layout_q31(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank,
                                                          uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, bank) ? prepare(self, bank) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

PVID_COLD void pvid_differentiator_reset_q31(pvid_differentiator_q31 *self)
{
    self->head = 0;
    self->at = 0;
    self->missing = self->length;
    for (size_t i = 0; i < self->length; i++) {
        self->history[i][PHI] = 0;
        self->history[i][Y] = 0;
    }
}

/* Adds a sample of each channel to the sums of a block, which are exact. Returns whether it is complete. */
static PVID_NOINLINE bool add_to_block(pvid_differentiator_q31 *self, int32_t phi, int32_t y)
{
    const uint32_t samples = (uint32_t)self->at + 1u;
    int32_t *point = self->history[self->head];
    point[PHI] = (samples == 1u) ? phi : (point[PHI] + phi);
    point[Y] = (samples == 1u) ? y : (point[Y] + y);
    const bool complete = samples == self->bank.block;
    self->at = (uint16_t)(complete ? 0u : samples);
    return complete;
}

/* Takes a sample of each channel. Returns whether it completes a point, and the window is full. */
static bool push(pvid_differentiator_q31 *self, int32_t phi, int32_t y)
{
    if (self->bank.block > 1u) {
        if (!add_to_block(self, phi, y)) {
            return false;
        }
    } else {
        int32_t *point = self->history[self->head];
        point[PHI] = phi;
        point[Y] = y;
    }
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
    if (self->missing > 0u) {
        self->missing--;
    }
    return self->missing == 0u;
}

/* The place `ahead` after the oldest point, ahead <= length. */
static const int32_t *point_after(const pvid_differentiator_q31 *self, size_t ahead)
{
    const size_t place = self->head + ahead;
    return self->history[(place >= self->length) ? (place - self->length) : place];
}

/* Both signals by a bank whose sums fit 32 bits. */
static void differentiate_five(const pvid_differentiator_q31 *self, int32_t d_phi[PVID_ORDERS],
                               int32_t d_y[PVID_Y_ORDERS_Q31])
{
    const size_t stride = self->bank.stride;
    const int32_t *before_2 = self->history[self->head];
    const int32_t *before = point_after(self, stride);
    const int32_t *middle = point_after(self, 2u * stride);
    const int32_t *after = point_after(self, 3u * stride);
    const int32_t *after_2 = point_after(self, 4u * stride);
    const int32_t phi_twice = 2 * middle[PHI];
    const int32_t phi_even = (after[PHI] + before[PHI]) - phi_twice;
    const int32_t phi_even_2 = (after_2[PHI] + before_2[PHI]) - phi_twice;
    const int32_t phi_odd = after[PHI] - before[PHI];
    const int32_t phi_odd_2 = after_2[PHI] - before_2[PHI];
    const int32_t y_twice = 2 * middle[Y];
    const int32_t y_even = (after[Y] + before[Y]) - y_twice;
    const int32_t y_even_2 = (after_2[Y] + before_2[Y]) - y_twice;
    d_phi[0] = PVID_FIVE_POINTS_CENTRE_Q31 * middle[PHI];
    d_phi[1] = (8 * phi_odd) - phi_odd_2;
    d_phi[2] = (16 * phi_even) - phi_even_2;
    d_phi[3] = (6 * phi_odd_2) - (12 * phi_odd);
    d_phi[4] = (12 * phi_even_2) - (48 * phi_even);
    d_y[0] = (16 * y_even) - y_even_2;
    d_y[1] = (6 * (after_2[Y] - before_2[Y])) - (12 * (after[Y] - before[Y]));
    d_y[2] = (12 * y_even_2) - (48 * y_even);
}

static int32_t rounded(int64_t sum, uint8_t shift)
{
    return (int32_t)pvid_round_shift_q31(sum, shift);
}

/* A weight times a difference; on a core without a long multiplication 32 bits are enough where there is no block. */
static inline int64_t weighted(int32_t weight, int32_t difference, bool wide)
{
#if defined(__ARM_ARCH_6M__)
    return wide ? pvid_product_q31(weight, difference) : (int64_t)(weight * difference);
#else
    (void)wide;
    return pvid_product_q31(weight, difference);
#endif
}

PVID_NOINLINE static void differentiate(const pvid_differentiator_q31 *self, int32_t d_phi[PVID_ORDERS],
                                        int32_t d_y[PVID_Y_ORDERS_Q31])
{
    const size_t length = self->length;
    const size_t half = self->bank.half;
    const size_t stride = self->bank.stride;
    const bool wide = self->bank.block > 1u;
    /* head is the oldest point; the centre is half * stride after it */
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
        phi0 += weighted(weight[0], even_phi, wide);
        phi1 += weighted(weight[half], odd_phi, wide);
        phi2 += weighted(weight2, even_phi, wide);
        phi3 += weighted(weight3, odd_phi, wide);
        phi4 += weighted(weight4, even_phi, wide);
        y2 += weighted(weight2, even_y, wide);
        y3 += weighted(weight3, odd_y, wide);
        y4 += weighted(weight4, even_y, wide);
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
}

bool pvid_differentiator_step_q31(pvid_differentiator_q31 *self, int32_t phi, int32_t y, int32_t d_phi[PVID_ORDERS],
                                  int32_t d_y[PVID_Y_ORDERS_Q31])
{
    const bool ready = self->bank.weights != NULL;
    PVID_ASSERT(ready);
    if (!ready || !push(self, phi, y)) {
        return false;
    }
    if (self->five_points) {
        differentiate_five(self, d_phi, d_y);
    } else {
        differentiate(self, d_phi, d_y);
    }
    return true;
}
