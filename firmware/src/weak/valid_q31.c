#include "weak/valid_q31.h"

#include <stdbool.h>
#include <stddef.h>

#include "number/integer_q31.h"
#include "number/rescale_q31.h"
#include "weak/sums_q31.h"
#include "weak/values_q31.h"
#include "weak/weak_front_q31.h"
#include "weak/weak_signals.h"

#define COUNTS_LIMIT INT32_C(0x01000000) /* 2^24 */
#define LEAST_FUNCTIONS 4u
#define MOST_HOP 4096u
#define MOST_TERMS 15u    /* of a column */
#define WORD 62u          /* largest shift of an int64 */
#define EXPONENT_MAX 8192 /* of a factor */
#define PLACES 32u        /* of shifts of an int32 */
#define MOST_UP 30u
#define MOST_SUM_SHIFT 16u /* half a unit of what is left is then below what four products leave free: 2^16 */
#define LEAST_SHIFT 2u     /* of an integral's end */

static bool counts_fit(const pvid_weak_model_q31 *model)
{
    const uint32_t inputs = (uint32_t)model->jets + model->runs + model->signs;
    return (model->samples >= 1u) && (model->samples <= PVID_MAX_SAMPLES) && (model->signals >= 1u) &&
           (model->jets >= 1u) && (inputs <= PVID_MAX_INPUTS) && (model->runs <= PVID_MAX_INTEGRANDS) &&
           (model->signs <= PVID_MAX_INTEGRANDS) && (model->gains >= 1u) && (model->gains <= PVID_MAX_CHANNELS) &&
           (model->integrands <= PVID_MAX_INTEGRANDS) && (model->channels >= 1u) &&
           (model->channels <= (PVID_MAX_CHANNELS + 1u)) && (model->kinds >= 1u) && (model->kinds <= PVID_MAX_KINDS);
}

static bool tables_are_given(const pvid_weak_model_q31 *model)
{
    const bool prepares = ((uint32_t)model->runs + model->signs) > 0u;
    return (model->signal != NULL) && (model->jet != NULL) && (model->channel != NULL) && (model->term != NULL) &&
           (model->kind != NULL) && (model->values != NULL) && (model->model != NULL) &&
           (!prepares || (model->prepare != NULL));
}

/* Channel `place` is summed and is this one. */
static bool is_channel(const pvid_weak_model_q31 *model, uint8_t place, uint8_t gain, uint8_t fold)
{
    return (place < model->channels) && (model->channel[place].gain == gain) && (model->channel[place].fold == fold) &&
           ((fold == 0u) || (model->channel[place].integrand == PVID_WEAK_NONE));
}

/* A constant is the last channel. */
static bool channel_is_valid(const pvid_weak_model_q31 *model, size_t place)
{
    const pvid_weak_channel *one = &model->channel[place];
    if (one->gain == PVID_WEAK_NONE) {
        return (one->fold == 0u) && (place > 0u) && ((place + 1u) == model->channels);
    }
    const bool shifts =
        (one->fold == 0u) || (is_channel(model, one->plain, one->gain, 0) &&
                              ((one->integrand == PVID_WEAK_NONE) || (one->integrand < model->integrands)));
    return (one->gain < model->gains) && (one->fold <= 2u) && shifts &&
           ((one->fold < 2u) || is_channel(model, one->ramp, one->gain, 1));
}

static bool channels_are_valid(const pvid_weak_model_q31 *model)
{
    bool valid = pvid_weak_summed_q31(model) <= (size_t)PVID_MAX_CHANNELS; /* a constant is not stored */
    for (size_t i = 0; i < model->channels; i++) {
        valid = valid && channel_is_valid(model, i);
    }
    return valid;
}

static bool factor_is_valid(pvid_scaled_q31 factor)
{
    return (factor.m >= -PVID_ONE_Q30) && (factor.m <= PVID_ONE_Q30) && (factor.e >= -EXPONENT_MAX) &&
           (factor.e <= EXPONENT_MAX);
}

static bool terms_are_valid(const pvid_weak_design_q31 *design, const pvid_weak_kind *kind, uint32_t columns)
{
    uint32_t of_column = 0;
    for (size_t i = kind->first; i < kind->end; i++) {
        const pvid_weak_term_q31 *one = &design->model->term[i];
        const bool first = (i == kind->first);
        const uint8_t before = first ? one->column : design->model->term[i - 1u].column;
        of_column = (first || (one->column != before)) ? 1u : (of_column + 1u);
        if ((one->channel >= design->model->channels) || (one->column >= columns) || (one->column < before) ||
            (((uint32_t)one->order + 2u) > design->power) || (of_column > MOST_TERMS) ||
            !factor_is_valid(design->factor[i])) {
            return false;
        }
    }
    return true;
}

static bool kinds_are_valid(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    const bool single = (model->kinds == 1u) && (model->model->n_kinds <= 1u);
    if (!single && ((model->model->n_kinds != model->kinds) || (model->model->kind_end == NULL))) {
        return false;
    }
    uint32_t thetas = 0;
    uint32_t first = 0;
    for (size_t i = 0; i < model->kinds; i++) {
        const pvid_weak_kind *kind = &model->kind[i];
        const uint32_t columns = (uint32_t)kind->thetas + 1u + kind->nuisances;
        thetas += kind->thetas;
        if ((kind->thetas < 1u) || (columns > PVID_MAX_COLUMNS) || (kind->nuisances >= design->functions) ||
            (kind->first != first) || (kind->end <= kind->first) || !terms_are_valid(design, kind, columns) ||
            (!single && (model->model->kind_end[i] != thetas))) {
            return false;
        }
        first = kind->end;
    }
    return (thetas == model->model->n_theta) && (thetas <= PVID_MAX_THETA_Q31);
}

/* Largest integer of a signal of this source over full scale. */
static int64_t reach_of(uint8_t source)
{
    return (source == (uint8_t)PVID_SIGNAL_HELD) ? 28 : ((source == (uint8_t)PVID_SIGNAL_JUMP) ? 2 : 1);
}

/* D^2 |signal| fits an int32, and 28 bits once shifted. */
static bool full_scale_is_valid(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    const int64_t square = (int64_t)design->decimation * (int64_t)design->decimation;
    bool valid = true;
    for (size_t i = 0; i < model->samples; i++) {
        valid = valid && (design->full_scale[i] > 0) && (design->full_scale[i] <= COUNTS_LIMIT);
    }
    for (size_t i = 0; valid && (i < model->signals); i++) {
        const int64_t most = square * reach_of(model->signal[i].source) * design->full_scale[model->signal[i].sample];
        valid = (most <= INT32_MAX) && (design->down[i] < PLACES) &&
                (pvid_floor_shift_q31(most, design->down[i]) <= PVID_WEAK_LIMIT_Q31);
    }
    return valid;
}

/* The block sums of a signal, shifted. Requires a valid full scale. */
static int64_t most_of(const pvid_weak_design_q31 *design, size_t signal)
{
    const pvid_weak_signal one = design->model->signal[signal];
    const int64_t square = (int64_t)design->decimation * (int64_t)design->decimation;
    return pvid_floor_shift_q31(square * reach_of(one.source) * design->full_scale[one.sample], design->down[signal]) +
           1;
}

/* Weights times sums of four block sums fit 62 bits. */
static bool filters_are_valid(const pvid_weak_design_q31 *design)
{
    for (size_t i = 0; i < design->model->jets; i++) {
        const pvid_weak_filter_q31 *filter = &design->filter[i];
        const pvid_weak_jet jet = design->model->jet[i];
        const size_t weights = (size_t)filter->half + 1u;
        uint64_t whole = 0;
        if ((filter->half > PVID_MAX_RING) || (filter->down > WORD) || (filter->weights == NULL)) {
            return false;
        }
        for (size_t k = 0; k < weights; k++) {
            const uint64_t one = pvid_magnitude_q31(filter->weights[k]);
            if (one > (uint64_t)PVID_ONE_Q30) {
                return false;
            }
            whole += one;
        }
        if (whole > ((uint64_t)PVID_WIDE / (4u * (uint64_t)most_of(design, jet.signal)))) {
            return false;
        }
    }
    return true;
}

static bool shifts_are_valid(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    /* products of hop steps of 29 bits, and one off for each block, fit 30 bits */
    const int64_t sums = (int64_t)design->hop * ((int64_t)1 << 29);
    bool valid = (design->sum_shift >= 1u) && (design->sum_shift <= MOST_SUM_SHIFT) &&
                 ((pvid_floor_shift_q31(sums, design->sum_shift) + design->hop) < PVID_ONE_Q30);
    for (size_t i = 0; i < model->channels; i++) {
        const pvid_weak_format_q31 *one = &design->format[i];
        const int64_t hop = design->hop;
        const int64_t most = (model->channel[i].fold == 1u) ? (2 * hop) : (24 * hop * hop);
        valid = valid && ((one->value >= 1u) || (model->channel[i].gain == PVID_WEAK_NONE)) &&
                (one->value <= MOST_UP) && (one->own < PLACES) && (one->plain <= WORD) && (one->ramp <= WORD) &&
                ((model->channel[i].fold < 1u) || (one->plain >= LEAST_SHIFT)) &&
                ((model->channel[i].fold < 2u) || (one->ramp >= LEAST_SHIFT)) && (one->lift <= MOST_UP) &&
                ((one->lift == 0u) || (most <= pvid_floor_shift_q31(INT32_MAX, one->lift)));
    }
    for (size_t i = 0; i < model->integrands; i++) {
        const pvid_weak_integral_q31 *one = &design->integral[i];
        valid = valid && (one->down <= MOST_UP) && (one->twice >= 1u) && (one->twice <= MOST_UP);
    }
    for (size_t i = 0; i < model->runs; i++) {
        valid = valid && pvid_rescale_is_valid_q31(&design->run[i]);
    }
    for (size_t i = 0; i < model->signs; i++) {
        valid = valid && (design->sign_width[i] >= 0);
    }
    return valid;
}

/* Each kind has noise of the sensors or an error of its own. */
static bool noise_is_valid(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    for (size_t i = 0; i < design->n_noise; i++) {
        const pvid_weak_noise_q31 *one = &design->noise[i];
        if ((one->kind >= model->kinds) || (one->power >= design->power) || (one->a > one->b) ||
            (one->b > model->kind[one->kind].thetas) || !factor_is_valid(one->factor)) {
            return false;
        }
    }
    for (size_t kind = 0; kind < model->kinds; kind++) {
        if ((design->error_order[kind] >= design->power) || (design->error_variance[kind].m < 0) ||
            !factor_is_valid(design->error_variance[kind])) {
            return false;
        }
    }
    return true;
}

static bool design_is_given(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    return (design->full_scale != NULL) && (design->down != NULL) && (design->filter != NULL) &&
           (design->format != NULL) && (design->factor != NULL) && (design->error_order != NULL) &&
           (design->error_variance != NULL) && (design->circle != NULL) &&
           ((design->noise != NULL) || (design->n_noise == 0u)) && ((design->run != NULL) || (model->runs == 0u)) &&
           ((design->sign_width != NULL) || (model->signs == 0u)) &&
           ((design->integral != NULL) || (model->integrands == 0u));
}

/* Its numbers of functions, steps and ticks. */
static pvid_status sizes_are_valid(const pvid_weak_design_q31 *design)
{
    if ((design->functions < LEAST_FUNCTIONS) || (design->functions > PVID_MAX_FUNCTIONS) || (design->power < 2u) ||
        ((design->power % 2u) != 0u) || (design->power > PVID_MAX_POWER)) {
        return PVID_BAD_FUNCTIONS;
    }
    const uint32_t harmonics = ((uint32_t)design->functions / 2u) + ((uint32_t)design->power / 2u) + 1u;
    if (harmonics > PVID_MAX_HARMONICS) {
        return PVID_BAD_FUNCTIONS;
    }
    if ((design->decimation < 1u) || (design->decimation > PVID_MAX_DECIMATION)) {
        return PVID_BAD_DECIMATION;
    }
    const bool fits = (design->hop >= harmonics) && (design->hop >= (2u * (uint32_t)PVID_WEAK_BLOCK_Q31)) &&
                      (design->hop <= MOST_HOP) && ((design->hop % (uint16_t)PVID_WEAK_BLOCK_Q31) == 0u);
    return fits ? PVID_OK : PVID_BAD_WINDOW;
}

/* In a build for one design: the counts that are constants there (number/exact.h). */
static bool is_exact(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    return (design->functions == PVID_MAX_FUNCTIONS) && (design->power == PVID_MAX_POWER) &&
           (pvid_weak_harmonics_q31(design) == PVID_MAX_HARMONICS) && (model->samples == PVID_MAX_SAMPLES) &&
           (model->signals == PVID_EXACT_SIGNALS) && (model->jets == PVID_EXACT_JETS) &&
           (model->runs == PVID_EXACT_RUNS) && (model->signs == PVID_EXACT_SIGNS) &&
           (model->gains == PVID_EXACT_GAINS) && (model->integrands == PVID_EXACT_INTEGRANDS) &&
           (pvid_weak_summed_q31(model) == PVID_EXACT_CHANNELS);
}

/* Every number of the tables. */
static pvid_status tables_are_valid(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    if (!pvid_weak_signals_are_valid(model->signal, model->signals, model->samples, model->jet, model->jets) ||
        !channels_are_valid(model) || !kinds_are_valid(design)) {
        return PVID_BAD_MODEL;
    }
    if (!full_scale_is_valid(design)) {
        return PVID_BAD_FULL_SCALE;
    }
    if (!filters_are_valid(design) || !noise_is_valid(design)) {
        return PVID_BAD_DESIGN;
    }
    return shifts_are_valid(design) ? PVID_OK : PVID_BAD_SHIFT;
}

pvid_status pvid_weak_valid_q31(const pvid_weak_design_q31 *design)
{
    if (design == NULL) {
        return PVID_BAD_DESIGN;
    }
    const pvid_weak_model_q31 *model = design->model;
    if ((model == NULL) || !counts_fit(model) || !tables_are_given(model)) {
        return PVID_BAD_MODEL;
    }
    pvid_status status = sizes_are_valid(design);
    if (status != PVID_OK) {
        return status;
    }
    if (!design_is_given(design)) {
        return PVID_BAD_DESIGN;
    }
    if ((PVID_EXACT != 0) && !is_exact(design)) {
        return PVID_BAD_DESIGN;
    }
    status = (PVID_CHECK_TABLES != 0) ? tables_are_valid(design) : PVID_OK;
    if (status != PVID_OK) {
        return status;
    }
    return (pvid_weak_front_length_q31(design) <= PVID_MAX_RING) ? PVID_OK : PVID_BAD_TAPS;
}
