#include "number/uncontracted.h"

#include "weak/valid_f32.h"

#include <stdbool.h>
#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "weak/weak_front_f32.h"
#include "weak/weak_signals.h"

static bool all_within(const float values[], size_t n, float low)
{
    for (size_t i = 0; i < n; i++) {
        if (!pvid_within_f32(values[i], low, 3.4e38f)) {
            return false;
        }
    }
    return true;
}

static bool counts_fit(const pvid_weak_model_f32 *model)
{
    const uint32_t inputs = (uint32_t)model->jets + model->runs + model->signs;
    return (model->samples >= 1u) && (model->samples <= PVID_MAX_SAMPLES) && (model->signals >= 1u) &&
           (model->jets >= 1u) && (inputs <= PVID_MAX_INPUTS) && (model->runs <= PVID_MAX_INTEGRANDS) &&
           (model->signs <= PVID_MAX_INTEGRANDS) && (model->gains >= 1u) && (model->gains <= PVID_MAX_CHANNELS) &&
           (model->integrands <= PVID_MAX_INTEGRANDS) && (model->channels >= 1u) && (model->kinds >= 1u) &&
           (model->kinds <= PVID_MAX_KINDS);
}

static bool tables_are_given(const pvid_weak_model_f32 *model)
{
    const bool prepares = ((uint32_t)model->runs + model->signs) > 0u;
    return (model->signal != NULL) && (model->jet != NULL) && (model->channel != NULL) && (model->term != NULL) &&
           (model->kind != NULL) && (model->values != NULL) && (model->form != NULL) && (model->model != NULL) &&
           (!prepares || (model->prepare != NULL));
}

/* Channel `place` is summed and is this one. */
static bool is_channel(const pvid_weak_model_f32 *model, uint8_t place, uint8_t gain, uint8_t fold)
{
    return (place < model->channels) && (place < PVID_MAX_CHANNELS) && (model->channel[place].gain == gain) &&
           (model->channel[place].fold == fold) &&
           ((fold == 0u) || (model->channel[place].integrand == PVID_WEAK_NONE));
}

static bool channel_is_valid(const pvid_weak_model_f32 *model, size_t place)
{
    const pvid_weak_channel *one = &model->channel[place];
    if (one->gain == PVID_WEAK_NONE) {
        return one->fold == 0u;
    }
    const bool shifts =
        (one->fold == 0u) || (is_channel(model, one->plain, one->gain, 0) &&
                              ((one->integrand == PVID_WEAK_NONE) || (one->integrand < model->integrands)));
    return (place < PVID_MAX_CHANNELS) && (one->gain < model->gains) && (one->fold <= 2u) && shifts &&
           ((one->fold < 2u) || is_channel(model, one->ramp, one->gain, 1));
}

static bool channels_are_valid(const pvid_weak_model_f32 *model)
{
    bool valid = true;
    bool any = false;
    for (size_t i = 0; i < model->channels; i++) {
        valid = valid && channel_is_valid(model, i);
        any = any || (model->channel[i].gain != PVID_WEAK_NONE);
    }
    return valid && any;
}

static bool terms_are_valid(const pvid_weak_model_f32 *model, const pvid_weak_kind *kind, uint32_t columns,
                            uint32_t power)
{
    uint8_t before = 0;
    for (size_t i = kind->first; i < kind->end; i++) {
        const pvid_weak_term_f32 *one = &model->term[i];
        if ((one->channel >= model->channels) || (one->column >= columns) || (one->column < before) ||
            ((uint32_t)one->order + 2u > power) || !pvid_finite_f32(one->factor)) {
            return false;
        }
        before = one->column;
    }
    return true;
}

static bool kinds_are_valid(const pvid_weak_design_f32 *design)
{
    const pvid_weak_model_f32 *model = design->model;
    uint32_t thetas = 0;
    uint32_t first = 0;
    for (size_t i = 0; i < model->kinds; i++) {
        const pvid_weak_kind *kind = &model->kind[i];
        const uint32_t columns = (uint32_t)kind->thetas + 1u + kind->nuisances;
        if ((kind->thetas < 1u) || (columns > PVID_MAX_COLUMNS) || (kind->nuisances >= design->functions) ||
            (kind->first != first) || (kind->end <= kind->first) ||
            !terms_are_valid(model, kind, columns, design->power)) {
            return false;
        }
        thetas += kind->thetas;
        first = kind->end;
    }
    /* the estimator checks its blocks: those of the kinds must be these */
    const bool single = (model->model->n_kinds <= 1u) && (model->kinds == 1u);
    return (thetas == model->model->n_theta) && (thetas <= PVID_MAX_THETA) &&
           (single || (model->model->n_kinds == model->kinds));
}

static bool filters_are_valid(const pvid_weak_design_f32 *design)
{
    for (size_t i = 0; i < design->model->jets; i++) {
        const pvid_weak_filter_f32 *filter = &design->compensator[i];
        const bool none = (filter->half == 0u) && (design->model->jet[i].order == 0u);
        const bool some = (filter->half > 0u) && (filter->half <= PVID_MAX_RING) && (filter->weights != NULL) &&
                          all_within(filter->weights, filter->half, -3.4e38f);
        if (!none && !some) {
            return false;
        }
    }
    return true;
}

/* Each kind has noise of the sensors or an error of its own. */
static bool noise_is_valid(const pvid_weak_design_f32 *design)
{
    const pvid_weak_model_f32 *model = design->model;
    for (size_t i = 0; i < design->n_noise; i++) {
        const pvid_weak_noise_f32 *one = &design->noise[i];
        if ((one->kind >= model->kinds) || (one->power >= design->power) || (one->a > one->b) ||
            (one->b > model->kind[one->kind].thetas) || !pvid_finite_f32(one->factor)) {
            return false;
        }
    }
    for (size_t kind = 0; kind < model->kinds; kind++) {
        bool any = design->error_variance[kind] > 0.0f;
        for (size_t i = 0; i < design->n_noise; i++) {
            any = any || (design->noise[i].kind == kind);
        }
        if (!any || (design->error_order[kind] >= design->power)) {
            return false;
        }
    }
    return all_within(design->error_variance, model->kinds, 0.0f);
}

static pvid_status model_is_valid(const pvid_weak_model_f32 *model)
{
    const bool valid =
        (model != NULL) && counts_fit(model) && tables_are_given(model) &&
        ((PVID_CHECK_TABLES == 0) ||
         (pvid_weak_signals_are_valid(model->signal, model->signals, model->samples, model->jet, model->jets) &&
          channels_are_valid(model)));
    return valid ? PVID_OK : PVID_BAD_MODEL;
}

/* In a build for one design: the counts that are constants there (number/exact.h). */
static bool is_exact(const pvid_weak_design_f32 *design)
{
    const pvid_weak_model_f32 *model = design->model;
    const uint32_t harmonics = ((uint32_t)design->functions / 2u) + ((uint32_t)design->power / 2u) + 1u;
    return (design->functions == PVID_MAX_FUNCTIONS) && (design->power == PVID_MAX_POWER) &&
           (harmonics == PVID_MAX_HARMONICS) && (design->decimation == PVID_MAX_DECIMATION) &&
           (pvid_weak_front_length_f32(design) <= PVID_MAX_RING) && (model->samples == PVID_MAX_SAMPLES) &&
           (model->signals == PVID_EXACT_SIGNALS) && (model->jets == PVID_EXACT_JETS) &&
           (model->runs == PVID_EXACT_RUNS) && (model->signs == PVID_EXACT_SIGNS) &&
           (model->gains == PVID_EXACT_GAINS) && (model->integrands == PVID_EXACT_INTEGRANDS) &&
           (model->model->n_p == PVID_MAX_P);
}

static pvid_status sizes_are_valid(const pvid_weak_design_f32 *design)
{
    const uint32_t harmonics = ((uint32_t)design->functions / 2u) + ((uint32_t)design->power / 2u) + 1u;
    if ((design->decimation < 1u) || (design->decimation > PVID_MAX_DECIMATION)) {
        return PVID_BAD_DECIMATION;
    }
    if ((design->power < 2u) || (design->power > PVID_MAX_POWER) || ((design->power % 2u) != 0u)) {
        return PVID_BAD_DESIGN;
    }
    if ((design->functions < 4u) || (design->functions > PVID_MAX_FUNCTIONS) || (harmonics > PVID_MAX_HARMONICS)) {
        return PVID_BAD_FUNCTIONS;
    }
    if ((design->hop < (2u * PVID_WEAK_BLOCK)) || (design->hop > 16384u) || ((design->hop % PVID_WEAK_BLOCK) != 0u) ||
        (design->hop < (2u * harmonics))) {
        return PVID_BAD_WINDOW;
    }
    return PVID_OK;
}

/* Every number of the tables. */
static pvid_status tables_are_valid(const pvid_weak_design_f32 *design)
{
    const bool given = (design->circle != NULL) && (design->error_order != NULL) && (design->error_variance != NULL) &&
                       ((design->noise != NULL) || (design->n_noise == 0u)) &&
                       ((design->sign_width != NULL) || (design->model->signs == 0u));
    if (!given || !filters_are_valid(design) || !all_within(design->circle, (5u * (size_t)design->hop) / 2u, -1.0f) ||
        !all_within(design->sign_width, design->model->signs, 0.0f) ||
        ((design->sign_doubt != NULL) && !all_within(design->sign_doubt, design->model->signs, 0.0f))) {
        return PVID_BAD_DESIGN;
    }
    if (!kinds_are_valid(design)) {
        return PVID_BAD_MODEL;
    }
    return noise_is_valid(design) ? PVID_OK : PVID_BAD_DESIGN;
}

PVID_COLD pvid_status pvid_weak_valid_f32(const pvid_weak_design_f32 *design)
{
    if (design == NULL) {
        return PVID_BAD_DESIGN;
    }
    if ((PVID_EXACT != 0) && (PVID_CHECK_TABLES == 0)) {
        return (design->model == NULL) ? PVID_BAD_MODEL : (is_exact(design) ? PVID_OK : PVID_BAD_DESIGN);
    }
    pvid_status status = model_is_valid(design->model);
    if (status != PVID_OK) {
        return status;
    }
    status = sizes_are_valid(design);
    if (status != PVID_OK) {
        return status;
    }
    if (design->compensator == NULL) {
        return PVID_BAD_DESIGN;
    }
    if ((PVID_EXACT != 0) && !is_exact(design)) {
        return PVID_BAD_DESIGN;
    }
    if (!pvid_within_f32(design->overlap, 1.0f, 1.0e6f)) {
        return PVID_BAD_OVERLAP;
    }
    if (pvid_weak_front_length_f32(design) > PVID_MAX_RING) {
        return PVID_BAD_TAPS;
    }
    return (PVID_CHECK_TABLES != 0) ? tables_are_valid(design) : PVID_OK;
}
