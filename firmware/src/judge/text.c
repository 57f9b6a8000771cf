/* pvid/text.h. Printed by tools/print_headers.py from pvid/status.h: do not edit. */
#include "pvid/text.h"

#include <stddef.h>

#if PVID_TEXTS

/* clang-format off */
static const char *const reasons[] = {
    "updated",
    "warming up",
    "accumulated",
    "held not excited",
    "held singular",
    "rejected not finite",
    "rejected outlier",
    "rejected saturated",
    "held uncertain",
    "held out of range",
    "misfit",
    "held frozen",
    "not ready",
    "held searching",
    "held block",
    "held disagrees",
};

static const char *const statuses[] = {
    "ok",
    "bad model: NULL, larger than the PVID_MAX_ bounds, or its kinds do not divide theta",
    "bad sample rate: not finite or outside 1e-3..1e6 Hz",
    "bad bank: weights of a bank: NULL, or one that is not finite",
    "bad start: start not finite, not positive for a positive parameter, or out of bounds",
    "bad start sd: not finite or not positive",
    "bad bounds: not finite, lower >= upper, or lower <= 0 for a positive parameter",
    "bad row sd: not finite or not positive",
    "bad update rate: not finite or outside 1e-6..1e6 Hz",
    "bad forgetting: not finite, negative, or shorter than 4 updates",
    "bad feedback: not finite or negative",
    "bad law: not one of pvid_law",
    "bad divider: 0",
    "bad step limit: not finite or outside (0, 0.9]",
    "bad kappa min: not finite or outside [0, 1)",
    "bad correlation: not finite or below 1",
    "bad drive min: not finite or negative; q31: or too large",
    "bad row weight: not finite or outside (0, 1]",
    "bad design: the design or a table is NULL, or a table is not finite or could overflow",
    "bad iterations: outside 1..PVID_MAX_ITERATIONS, or too many for the window's hop",
    "bad noise margin: not finite or outside 0..1e6",
    "bad publish kappa: kappa_min of trust.h not finite or outside [0, 1)",
    "bad se max: not finite or not positive",
    "bad misfit max: not finite, or neither 0 nor at least 1",
    "bad range: range of a signal: not finite or not positive",
    "bad gate sigmas: not finite, or neither 0 nor 2..1e3",
    "bad gate patience: not finite or outside 0..1e12 s",
    "bad dead zone: not finite or outside 0..100",
    "bad half: of a bank: below 2, or a window over PVID_MAX_WINDOW for every stride",
    "bad stride: of a bank: 0, or a window with its block over PVID_MAX_WINDOW",
    "bad centre: of a q31 bank: outside 1..2^30",
    "bad taps: filters of a design: longer than PVID_MAX_RING holds",
    "bad decimation: of a design: outside 1..PVID_MAX_DECIMATION",
    "bad window: hop of a design: too short for its work, or too long",
    "bad functions: of a design: outside 4..PVID_MAX_FUNCTIONS",
    "bad overlap: of a design: not finite or below 1",
    "bad full scale: of a sensor of a q31 form: not positive, too large, or too large for the weights",
    "bad shift: of a q31 design: beyond 64 bits, or too small for full scale",
    "bad drive ticks: rows_per_second of a q31 strong form: outside 1..2^30",
    "bad format: p_bits, n_bits or y_bits of a q31 estimator: outside -64..64",
    "bad renewal: of trust.h: not finite, or neither 0 nor 0.01..1e3",
    "bad shared: of trust.h: a standard deviation or correlation out of its range",
    "bad pointer: the object, the configuration or the bank is NULL",
    "bad layout: library and application were compiled with different sizes: layout.h; nothing was written",
    "bad excite parts: of an excitation: none or too many, an unknown kind, or steps without levels",
    "bad excite amplitude: of a part: not finite or outside 0..1e6; a level outside -1..1",
    "bad excite frequency: of a part: not finite, not positive, above half the sample rate, or a phase or a sweep out of its range",
    "bad excite limit: of a drive: not finite, beyond 1e6, or not low <= 0 <= high with low < high",
    "bad excite slew: of a drive: not finite, above 1e12, or below 1e-6 of the wider limit in a tick",
    "bad excite time: ramp_s or burst_s: not finite, below a tick, above 1e6 s or 2.1e9 ticks",
    "bad excite guard: too many, NULL, not low < soft_low < soft_high < high, or a field out of its range",
    "bad commission drives: too many, of unequal ramps or rates, a burst that is too short, or no such sample",
    "bad commission ring: ring, burst or passes out of range, or a ring too short for several passes",
    "bad commission check: check_scale, agree, misfit_max or restrained_max out of its range",
};
/* clang-format on */

const char *pvid_reason_text(pvid_reason reason)
{
    const size_t place = (size_t)reason;
    return (place < (sizeof reasons / sizeof reasons[0])) ? reasons[place] : "unknown reason";
}

const char *pvid_status_text(pvid_status status)
{
    const size_t place = (size_t)status;
    return (place < (sizeof statuses / sizeof statuses[0])) ? statuses[place] : "unknown status";
}

#else

const char *pvid_reason_text(pvid_reason reason)
{
    (void)reason;
    return "";
}

const char *pvid_status_text(pvid_status status)
{
    (void)status;
    return "";
}

#endif
