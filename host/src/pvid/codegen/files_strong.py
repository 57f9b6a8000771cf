"""The float32 files of a model's strong form: header and source of an identifier with samples in, parameters out."""

from __future__ import annotations

from pvid.codegen import c_functions, describe
from pvid.codegen.c_text import UNCONTRACTED, banner, c_comment, for_cpp, guarded
from pvid.codegen.files_functions import includes_of, model_struct
from pvid.codegen.functions import Function
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.strong import StrongFunctions

_HEADER = """\
/* Settings. */
typedef struct {{
    pvid_fir_bank_f32 bank; /* of all differentiators, see pvid/differentiator.h */
    float sample_rate_hz;   /* 1e-3..1e6 [Hz] */
    float row_sd[{upper}_KINDS]; /* standard deviation of Y - N^T theta of each kind of row [unit of its Y], > 0 */
    pvid_estimator_config_f32 estimator; /* start, bounds, law ..; its model, row_sd and update_rate_hz are ignored */
}} {name}_config_f32;

/* State; only the functions below write to it. */
typedef struct {{
    pvid_differentiator_f32 channel[{upper}_CHANNELS];
{members}    float inverse_sd[{upper}_KINDS];
    pvid_estimator_f32 estimator; /* p and counters; assess with pvid_estimator_assess_f32 */
}} {name}_f32;

/* theta and C of all rows. */
extern const pvid_model_f32 {name}_model_f32;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - row_sd is not in 1e-12..1e12 (PVID_BAD_ROW_SD), or
 *   - the bank, the rate or a field of `estimator` is out of its range (the status names it). */
pvid_status {name}_init_f32({name}_f32 *self, const {name}_config_f32 *config);

/* One sample of each signal, in the order of {upper}_SIGNALS above. A sample that is not finite empties the
 * windows and returns PVID_REJECTED_NOT_FINITE; PVID_WARMING_UP until they are full; then the rows of this instant are
 * added and solved: see pvid_estimator_update_f32. */
pvid_reason {name}_step_f32({name}_f32 *self, const float sample[{upper}_SIGNALS]);"""

_INIT = """\
static pvid_status prepare({name}_f32 *self, const {name}_config_f32 *config)
{{
    memset(self, 0, sizeof *self);
    for (size_t i = 0; i < {upper}_CHANNELS; i++) {{
        const pvid_status status =
            pvid_differentiator_init_f32(&self->channel[i], &config->bank, config->sample_rate_hz);
        if (status != PVID_OK) {{
            return status;
        }}
    }}
    for (size_t k = 0; k < {upper}_KINDS; k++) {{
        if (!(config->row_sd[k] >= 1.0e-12f) || !(config->row_sd[k] <= 1.0e12f)) {{
            return PVID_BAD_ROW_SD;
        }}
        self->inverse_sd[k] = 1.0f / config->row_sd[k];
    }}
{settings}    pvid_estimator_config_f32 estimator = config->estimator;
    estimator.model = &{name}_model_f32;
    estimator.row_sd = 1.0f;
    estimator.update_rate_hz = config->sample_rate_hz;
    return pvid_estimator_init_f32(&self->estimator, &estimator);
}}

pvid_status {name}_init_f32({name}_f32 *self, const {name}_config_f32 *config)
{{
    const pvid_status status = ((self == NULL) || (config == NULL)) ? PVID_BAD_POINTER : prepare(self, config);
    if ((status != PVID_OK) && (self != NULL)) {{
        memset(self, 0, sizeof *self);
    }}
    return status;
}}"""

_INTEGRATE = """\
/* Integrals since the start of the run by the trapezoid rule; a missing sample repeats the one before. */
static void integrate({name}_f32 *self, const float sample[{upper}_SIGNALS], bool finite)
{{
    float now[{upper}_INTEGRANDS];
    memcpy(now, self->integrand, sizeof now);
    if (finite) {{
        float in[{upper}_INPUTS] = {{0.0f}};
{places}
        integrands(in, now);
    }}
    for (size_t i = 0; i < {upper}_INTEGRANDS; i++) {{
        const float before = self->is_running ? self->integrand[i] : now[i];
        if (self->is_running) {{
            self->integral[i] += self->half_period * (before + now[i]);
        }}
        self->integrand[i] = now[i];
    }}
    self->is_running = self->is_running || finite;
}}"""

_HOLD = """\
/* The values at the instant of the sample before the last: of a held input its mean around the instant, exact to the
 * fourth order. False until there are four samples. */
static bool centre({name}_f32 *self, const float now[{upper}_CHANNELS], float out[{upper}_CHANNELS])
{{
    static const bool held[{upper}_CHANNELS] = {{{held}}};
    for (size_t i = 0; i < {upper}_CHANNELS; i++) {{
        const float *past = self->past[i];
        out[i] = held[i] ? (((13.0f * (past[1] + past[2])) - (past[0] + now[i])) / 24.0f) : past[2];
        self->past[i][0] = past[1];
        self->past[i][1] = past[2];
        self->past[i][2] = now[i];
    }}
    const bool full = self->filled >= 3u;
    self->filled = full ? self->filled : (uint8_t)(self->filled + 1u);
    return full;
}}"""

_STEP = """\
/* Whether the samples are finite, by a difference that only finite numbers have. */
static bool are_finite(const float sample[{upper}_SIGNALS])
{{
    bool finite = true;
    for (size_t i = 0; i < {upper}_SIGNALS; i++) {{
        const float rest = sample[i] - sample[i];
        finite = finite && (rest >= 0.0f) && (rest <= 0.0f);
    }}
    return finite;
}}

static void restart({name}_f32 *self)
{{
    for (size_t i = 0; i < {upper}_CHANNELS; i++) {{
        pvid_differentiator_reset_f32(&self->channel[i]);
    }}
{emptied}}}

pvid_reason {name}_step_f32({name}_f32 *self, const float sample[{upper}_SIGNALS])
{{
    if ((self == NULL) || (self->estimator.model == NULL)) {{
        return PVID_NOT_READY;
    }}
    const bool finite = are_finite(sample);
{integrated}    if (!finite) {{
        restart(self);
        if (self->estimator.counters.rejected_not_finite < UINT32_MAX) {{
            self->estimator.counters.rejected_not_finite++;
        }}
        return PVID_REJECTED_NOT_FINITE;
    }}
    float now[{upper}_CHANNELS];
    memcpy(now, sample, {upper}_SIGNALS * sizeof now[0]);
{joined}{held}    float d[{upper}_CHANNELS][PVID_ORDERS];
    bool ready = true;
    for (size_t i = 0; i < {upper}_CHANNELS; i++) {{
        ready = pvid_differentiator_step_f32(&self->channel[i], now[i], d[i]) && ready;
    }}
    if (!ready) {{
        return PVID_WARMING_UP;
    }}
    const float in[{upper}_INPUTS] = {{{sources}}};
    float column[{upper}_COLUMNS];
    row(in, column);
    static const uint8_t theta_of[{upper}_KINDS + 1] = {{{ranges}}};
    size_t at = 0;
    for (uint8_t k = 0; k < {upper}_KINDS; k++) {{
        const size_t entries = (size_t)theta_of[k + 1u] - theta_of[k];
        float n[{upper}_THETA];
        for (size_t j = 0; j < entries; j++) {{
            n[j] = column[at + j] * self->inverse_sd[k];
        }}
        at += entries;
        (void)pvid_estimator_add_kind_f32(&self->estimator, k, n, column[at] * self->inverse_sd[k]);
        at++;
    }}
    return pvid_estimator_update_f32(&self->estimator);
}}"""


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_strong.h and NAME_strong_f32.c, where they are chosen."""
    if not model.options.strong:
        return {}
    return {
        f"{model.name}_strong.h": header(model.strong, model.command),
        f"{model.name}_strong_f32.c": source(model.strong, model.command),
    }


def header(strong: StrongFunctions, command: str) -> str:
    """NAME_strong.h; `strong` has the name NAME_strong."""
    functions = strong.functions
    name, upper = functions.name, functions.name.upper()
    n_theta, n_p = len(functions.theta.labels), len(functions.model.unknowns)
    needed = {
        "PVID_MAX_P": n_p,
        "PVID_MAX_THETA": n_theta,
        "PVID_MAX_MOMENTS": functions.moments,
    }
    samples = [
        (f"sample[{k}]", one.name, f"[{one.unit or '1'}]", "held until the next" if one.hold == "zoh" else "")
        for k, one in enumerate(strong.signals)
    ]
    about = [
        f"{name}.h - {functions.model.title}: parameters from derivatives of the signals (strong form), float32.",
        "",
        *banner(functions, command),
        "",
        f"  static {name}_f32 identifier;",
        f"  if ({name}_init_f32(&identifier, &config) != PVID_OK) ...",
        f"  each tick: {name}_step_f32(&identifier, sample); identifier.estimator.p is the estimate",
        "",
        "Samples:",
        *describe.table(samples),
        "",
        f"The library must be compiled with {', '.join(f'{macro} >= {size}' for macro, size in needed.items())}.",
        "Not thread-safe.",
        "",
        *describe.everything(functions),
    ]
    counts = {
        "P": n_p,
        "THETA": n_theta,
        "C": len(functions.c_row),
        "KINDS": len(functions.kinds),
        "SIGNALS": len(strong.signals),
        "CHANNELS": strong.channels,
        "INPUTS": len(functions.inputs),
        "COLUMNS": functions.columns,
    }
    members = ""
    if any(strong.held):
        members += f"    float past[{upper}_CHANNELS][3];\n    uint8_t filled;\n"
    if strong.integrals:
        counts["INTEGRANDS"] = len(strong.integrals)
        members += f"    float integral[{upper}_INTEGRANDS];\n    float integrand[{upper}_INTEGRANDS];\n"
        members += "    float half_period;\n    bool is_running;\n"
    body = [
        '#include "pvid/differentiator.h"',
        '#include "pvid/estimator.h"',
        "",
        f"#if {' || '.join(f'{macro} < {size}' for macro, size in needed.items())}",
        f'#error "compile pvid and this file with {" ".join(f"-D{macro}={size}" for macro, size in needed.items())}"',
        "#endif",
        "",
        *for_cpp(
            [
                *(f"#define {upper}_{what} {count}" for what, count in counts.items()),
                "",
                _HEADER.format(name=name, upper=upper, members=members),
                "",
            ]
        ),
    ]
    return guarded(name, about, body)


def source(strong: StrongFunctions, command: str) -> str:
    """NAME_strong_f32.c."""
    functions = strong.functions
    name, upper = functions.name, functions.name.upper()
    used = [strong.row, functions.theta, functions.jacobian, *([functions.integrands] if strong.integrals else [])]
    words = {"name": name, "upper": upper}
    parts = [
        c_comment(banner(functions, command)),
        UNCONTRACTED,
        includes_of(f"{name}.h", used, ("stdbool.h", "stddef.h", "string.h")),
        *(c_functions.float_function(_signature(strong, one), one.program) for one in used),
        model_struct(functions, "theta", "jacobian"),
        _INIT.format(
            settings="    self->half_period = 0.5f / config->sample_rate_hz;\n" if strong.integrals else "", **words
        ),
    ]
    if strong.integrals:
        places = [
            f"        in[{k}] = sample[{place}];"
            for k, one in enumerate(functions.inputs)
            if (place := strong.raw_places(one)) is not None
        ]
        parts.append(_INTEGRATE.format(places="\n".join(places), **words))
    if any(strong.held):
        held = [*strong.held, *(False for _ in strong.integrals)]
        parts.append(_HOLD.format(held=", ".join("true" if one else "false" for one in held), **words))
    joined = ""
    if strong.integrals:
        joined = f"    memcpy(&now[{upper}_SIGNALS], self->integral, sizeof self->integral);\n"
    parts.append(
        _STEP.format(
            emptied="    self->filled = 0;\n" if any(strong.held) else "",
            integrated="    integrate(self, sample, finite);\n" if strong.integrals else "",
            joined=joined,
            held=_centred(upper) if any(strong.held) else "",
            sources=", ".join(f"d[{one.channel}][{one.order}]" for one in strong.sources),
            ranges=", ".join(["0", *(str(kind.theta.stop) for kind in functions.kinds)]),
            **words,
        )
    )
    return "\n\n".join(parts) + "\n"


def _centred(upper: str) -> str:
    return f"""\
    float sampled[{upper}_CHANNELS];
    memcpy(sampled, now, sizeof sampled);
    if (!centre(self, sampled, now)) {{
        return PVID_WARMING_UP;
    }}
"""


def _signature(strong: StrongFunctions, function: Function) -> str:
    upper = strong.functions.name.upper()
    sizes = {"row": ("INPUTS", "COLUMNS"), "theta": ("P", "THETA"), "jacobian": ("P", "C")}
    given, written = sizes.get(function.name, ("INPUTS", "INTEGRANDS"))
    bounds = ("", "") if function.name in ("theta", "jacobian") else (f"{upper}_{given}", f"{upper}_{written}")
    return f"static void {function.name}(const float in[{bounds[0]}], float out[{bounds[1]}])"
