#include "judge/standing.h"

#include <stddef.h>

#include "number/count.h"
#include "number/unroll.h"

#define MEMORY 32u /* windows in the mean of the variance ratios */
#define ONE_Q16 65536u
#define FIT_MAX (ONE_Q16 + (ONE_Q16 / 2u)) /* largest mean of the ratios that is a fit without chance */
#define REJECTED_MAX 6u                    /* of the last 16 windows */
#define REJECTED_LAST 7u                   /* the last three: a wild sample is in two */
#define CONFIRMED 8u                       /* valid publications in a row: p is trusted */
#define PATIENCE 12u                       /* windows without a publication until p starts again */
#define STARTS 6u                          /* in a row; then */
#define PAUSE 64u                          /* windows until it may start again */

static void count_up(uint8_t *count)
{
    *count = (uint8_t)((*count < UINT8_MAX) ? (*count + 1u) : UINT8_MAX);
}

static uint8_t ones(uint16_t bits)
{
    uint8_t n = 0;
    for (uint32_t i = 0; i < 16u; i++) {
        n = (uint8_t)(n + (((uint32_t)bits >> i) & 1u));
    }
    return n;
}

static void set(pvid_standing_judge *self, pvid_standing_state state, uint32_t causes)
{
    self->now.state = (uint8_t)state;
    self->now.causes = (uint8_t)causes;
}

static bool stands(const pvid_standing_judge *self)
{
    return (self->now.state == (uint8_t)PVID_STANDING_VALID) || (self->now.state == (uint8_t)PVID_STANDING_DOUBTED);
}

/* Adds causes to an estimate that stands. */
static void doubt(pvid_standing_judge *self, uint32_t causes)
{
    if ((causes != 0u) && stands(self)) {
        set(self, PVID_STANDING_DOUBTED, self->now.causes | causes);
    }
}

/* Counts a window; returns the cause of the gate. */
static uint32_t count_window(pvid_standing_judge *self, bool rejected)
{
    pvid_count_up_16(&self->now.age);
    count_up(&self->windows);
    self->history = (uint16_t)(((uint32_t)self->history << 1u) | (rejected ? 1u : 0u));
    self->rejects = false;
    if ((self->starts >= STARTS) && (self->windows >= PAUSE)) {
        self->starts = 0;
    }
    const bool often = ones(self->history) >= REJECTED_MAX;
    const bool lately = ((uint32_t)self->history & REJECTED_LAST) == REJECTED_LAST;
    return (often || lately) ? (uint32_t)PVID_DOUBT_REJECTS : 0u;
}

/* The mean of n numbers, the last of them x. */
static uint32_t mean_with(uint32_t mean, uint32_t n, uint32_t x)
{
    return ((mean * (n - 1u)) + x) / n;
}

/* x^2 in Q16. */
static uint32_t square_q16(uint32_t x)
{
    return (uint32_t)(((uint64_t)x * x) >> 16u);
}

static uint32_t cause_of_age(const pvid_standing_judge *self, uint16_t age_max)
{
    return ((age_max > 0u) && (self->now.age > age_max)) ? (uint32_t)PVID_DOUBT_AGED : 0u;
}

PVID_COLD void pvid_standing_skip(pvid_standing_judge *self, bool rejected, uint16_t age_max)
{
    uint32_t causes = 0;
    if (rejected) {
        causes = count_window(self, true);
    } else {
        pvid_count_up_16(&self->now.age);
    }
    doubt(self, causes | cause_of_age(self, age_max));
}

/* The mean of the ratios is a misfit above both of its limits: 1.5 (1 + 3 chance), chance^2 = 2 / (freedom fits) of
 * white rows; and 1.5 + 3 own scatter, scatter^2 = 2 variance / (fits - 1) of the ratios themselves. An equation's own
 * error is not white: it has fewer degrees of freedom than its rows. 2: neighbours share half of their samples. */
static void take_fit(pvid_standing_judge *self, const pvid_standing_window *window)
{
    if (!window->judges || !(window->arrived || (self->fits > 0u))) {
        return;
    }
    self->fits = (uint8_t)((self->fits < MEMORY) ? (self->fits + 1u) : MEMORY);
    self->fit = mean_with(self->fit, self->fits, window->ratio);
    self->square = mean_with(self->square, self->fits, square_q16(window->ratio));
    const uint64_t excess = (self->fit > FIT_MAX) ? (self->fit - FIT_MAX) : 0u;
    const uint32_t fitted = square_q16(self->fit);
    const uint64_t variance = (self->square > fitted) ? (self->square - fitted) : 0u;
    const uint64_t of_own = variance * square_q16(window->own);
    const uint64_t rows = (uint64_t)window->freedom * self->fits;
    self->misfit = (self->fits >= PVID_STANDING_WINDOWS) &&
                   (((2u * rows) * (excess * excess)) > ((uint64_t)81u << 32u)) &&
                   (((excess * excess) * (self->fits - 1u)) > (18u * of_own));
}

/* A publication: valid without a cause, if it has been compared with enough windows. */
static void publish(pvid_standing_judge *self, uint32_t causes, bool compared)
{
    self->now.age = 0;
    self->silent = 0;
    self->contradicted = 0;
    if (causes != 0u) {
        self->valid = 0;
        set(self, PVID_STANDING_DOUBTED, causes);
    } else if (compared) {
        count_up(&self->valid);
        set(self, PVID_STANDING_VALID, 0);
    } else {
        /* too few windows: the state stays */
    }
}

PVID_COLD bool pvid_standing_take(pvid_standing_judge *self, const pvid_standing_window *window)
{
    uint32_t causes = count_window(self, self->rejects);
    if (window->solved) {
        take_fit(self, window);
    }
    causes |= (self->misfit || (window->judges && window->errs)) ? (uint32_t)PVID_DOUBT_MISFIT : 0u;
    /* not of the first few windows, whose scatter is not known */
    causes |= (window->solved && self->grew && stands(self)) ? (uint32_t)PVID_DOUBT_GREW : 0u;
    if (window->solved && window->arrived && self->contradicts) {
        count_up(&self->contradicted);
    } else {
        self->contradicted = 0;
    }
    if (window->published) {
        publish(self, causes, !window->judges || (self->fits >= PVID_STANDING_WINDOWS));
    } else {
        count_up(&self->silent);
        self->valid = 0;
        doubt(self, causes | cause_of_age(self, window->age_max));
        if (self->contradicted >= 2u) {
            set(self, PVID_STANDING_WITHDRAWN, self->now.causes | (uint32_t)PVID_DOUBT_CONTRADICTED);
        }
    }
    const bool trusted = self->valid >= CONFIRMED;
    self->starts = trusted ? 0u : self->starts;
    return trusted;
}

/* A start is due although the gate has not opened. Not while the standard errors only wait for more windows, not of an
 * estimate that is merely old, and not before the first publication: nothing but the start is known there, and an
 * equation's own error is being learned. */
static bool is_lost(const pvid_standing_judge *self, bool solved)
{
    const bool mute = self->silent >= PATIENCE;
    const bool away = !solved || (self->fits == 0u);
    const bool wrong = (self->starts > 0u) && (self->windows >= (2u * PATIENCE));
    const bool unsure = (self->now.causes & ~(uint32_t)PVID_DOUBT_AGED) != 0u;
    return unsure && (self->starts < STARTS) && ((mute && (self->misfit || away)) || (wrong && self->misfit));
}

PVID_COLD bool pvid_standing_starts(pvid_standing_judge *self, bool solved, uint8_t *number)
{
    if (self->opened) {
        self->starts = 0;
        set(self, PVID_STANDING_WITHDRAWN, PVID_DOUBT_CHANGED);
    } else if (!is_lost(self, solved)) {
        return false;
    } else {
        /* from another p */
    }
    *number = self->starts;
    self->starts++;
    self->opened = false;
    self->misfit = false;
    self->history = 0;
    self->fits = 0;
    self->contradicted = 0;
    self->valid = 0;
    self->silent = 0;
    self->windows = 0;
    return true;
}

/* Multiples of the golden section, 40503 / 2^16: evenly spread over any few of them in a row. */
PVID_COLD uint32_t pvid_standing_spread(uint8_t number, uint32_t a)
{
    if ((number == 0u) || ((number + 1u) == STARTS)) {
        return ONE_Q16 / 2u;
    }
    return (40503u * ((4u * a) + number)) % ONE_Q16;
}
