"""The fixed-point files of a model's strong form: header and source of an identifier, and a configuration for a rig.

The source prints what the model determines, and includes strong/strong_q31.h of the core, which is the same for all.
"""

from __future__ import annotations

from pvid.codegen import c_functions, describe
from pvid.codegen.c_text import banner, c_comment, for_cpp, guarded, initialised, inner
from pvid.codegen.files_weak import size_check
from pvid.codegen.files_weak_q31 import fields_of, numbers, parameters_in_c, structs
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.strong_q31 import FixedStrong, StrongQ31
from pvid.core.sizes import smallest
from pvid.settings.weak_q31 import Rescale

_HEADER = """\
/* Settings. They must outlive the identifier, unchanged. */
typedef struct {{
    pvid_bank_q31 bank; /* of all derivatives */
    int32_t full_scale[{upper}_SIGNALS]; /* of a reading about its offset, 1..2^24 [counts] */
    int32_t offset[{upper}_SIGNALS];     /* reading of each sensor at 0 [counts] */
    const int32_t *shared;       /* what no row shows, derivatives' bias above all: as of pvid/trust_q31.h, added to the
                                    standard errors. NULL: none. Must outlive the identifier */
    uint32_t rows_per_second;    /* 1..2^30, for the memories of gate and alarm */
    pvid_gate_config_q31 gate;   /* outlier gate on the innovations of an instant; zeros: none */
    pvid_estimator_config_q31 estimator; /* start, bounds, formats ..; model is ignored. divider: rows from solve to
                                            solve; gain 0: the law pseudovelocity */
}} {name}_config_q31;

/* State; only the functions below write to it. */
typedef struct {{
    const {name}_config_q31 *config; /* NULL before init has accepted one */
    uint16_t length;  /* places of the ring */
    uint16_t head;    /* place of the oldest point */
    uint16_t missing; /* points until the window is full */
    uint8_t before;   /* samples in front of a held input's mean */
    bool frozen;
    bool alarm;       /* the last block of rows was a misfit: see pvid/misfit.h */
{past}    int32_t points[PVID_MAX_WINDOW][{upper}_CHANNELS];
{integrals}    int32_t sense[{upper}_THETA]; /* p[0] dtheta/dp[0] 2^sense_shift in units of Y per N */
    int16_t sense_shift;
    pvid_gate_q31 gate;
    pvid_misfit_q31 misfit;
    pvid_estimator_q31 estimator; /* p, in the formats p_bits of the settings, and counters */
}} {name}_q31;

/* The init below, for an application with this word (pvid/layout.h). */
pvid_status {name}_init_layout_q31({name}_q31 *self, const {name}_config_q31 *config, uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library, this model and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged), or
 *   - a field is out of its range, or counts within full scale could overflow a sum (the status names it). */
static inline pvid_status {name}_init_q31({name}_q31 *self, const {name}_config_q31 *config)
{{
    return {name}_init_layout_q31(self, config, PVID_LAYOUT);
}}

/* One reading of each signal [counts], in the order above. Returns
 *   - PVID_WARMING_UP until the window is full, PVID_ACCUMULATED between solves,
 *   - PVID_REJECTED_SATURATED for a reading beyond full scale, which restarts the window, and for an instant whose
 *     derivatives or rows exceed their reach; the sums are kept,
 *   - PVID_REJECTED_OUTLIER for an instant that the gate rejects, PVID_HELD_FROZEN while frozen,
 *   - PVID_MISFIT instead of PVID_UPDATED during the alarm of pvid/misfit.h: do not trust the estimate,
 *   - PVID_HELD_NOT_EXCITED or PVID_HELD_SINGULAR where the rows do not determine p, else PVID_UPDATED. */
pvid_reason {name}_step_q31({name}_q31 *self, const int32_t reading[{upper}_SIGNALS]);

/* Standard errors, kappa and residual of the present p. Cost: about two solves. */
void {name}_assess_q31(const {name}_q31 *self, pvid_estimate_q31 *estimate);

/* Call this when samples are missing: the window restarts, all other state is kept. */
void {name}_gap_q31({name}_q31 *self);

/* Freezes the identifier (true) or resumes it (false). While frozen p and the sums are kept without forgetting. */
void {name}_freeze_q31({name}_q31 *self, bool frozen);"""


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_strong_q31.h and .c, NAME_strong_design_q31.h, where there is a rig."""
    strong_q31 = model.options.strong_q31
    return {} if strong_q31 is None else files_of(strong_q31, model.command)


def files_of(strong_q31: StrongQ31, command: str) -> dict[str, str]:
    """The same of an identifier.

    Parameters
    ----------
    command : that makes them; no date, so that the same command makes the same files
    """
    name = strong_q31.name
    return {
        f"{name}_q31.h": header(strong_q31, command),
        f"{name}_q31.c": source(strong_q31, command),
        f"{name}_design_q31.h": design_header(strong_q31, command),
    }


def header(strong_q31: StrongQ31, command: str) -> str:
    """NAME_strong_q31.h."""
    made = strong_q31.made
    strong, functions = made.strong, made.strong.functions
    name, upper = made.name, made.name.upper()
    readings = [
        (f"reading[{k}]", one.name, f"[{one.unit or '1'}]", "held until the next" if one.hold == "zoh" else "")
        for k, one in enumerate(strong.signals)
    ]
    about = [
        f"{name}_q31.h - {functions.model.title}: parameters from derivatives of the signals (strong form), integers "
        "only.",
        "",
        *banner(functions, command),
        "",
        f'  #include "{name}_design_q31.h"',
        f"  static {name}_q31 identifier;",
        f"  if ({name}_init_q31(&identifier, &{name}_config) != PVID_OK) ...",
        f"  each tick: {name}_step_q31(&identifier, reading); identifier.estimator.p is the estimate",
        "",
        "Its formats are those of a rig: the reach of each derivative. Readings of a tick, in counts:",
        *describe.table(readings),
        "",
        "Not thread-safe. Never allocates.",
        "",
        *describe.everything(functions),
    ]
    counts = {
        "SIGNALS": len(strong.signals),
        "CHANNELS": strong.channels,
        "INPUTS": len(functions.inputs),
        "KINDS": len(functions.kinds),
        "THETA": made.parameters.model.n_theta,
        "COLUMNS": functions.columns,
    }
    past = f"    int32_t past[{upper}_CHANNELS][3]; /* of the counts, around a held input */\n"
    integrals = ""
    if strong.integrals:
        counts["INTEGRANDS"] = len(strong.integrals)
        integrals = (
            f"    int64_t integral[{upper}_INTEGRANDS]; /* since the start of the run */\n"
            f"    int32_t integrand[{upper}_INTEGRANDS];\n    bool is_running;\n"
        )
    text = _HEADER.format(name=name, upper=upper, past=past if any(strong.held) else "", integrals=integrals)
    body = [
        '#include "pvid/bank_q31.h"',
        '#include "pvid/estimator_q31.h"',
        '#include "pvid/gate_q31.h"',
        '#include "pvid/misfit_q31.h"',
        "",
        *size_check({macro: size for macro, size in strong_q31.sizes.items() if macro != "PVID_MAX_WINDOW"}),
        "",
        *for_cpp([*(f"#define {upper}_{what} {count}" for what, count in counts.items()), "", text, ""]),
    ]
    return guarded(f"{name}_q31", about, body)


def source(strong_q31: StrongQ31, command: str) -> str:
    """NAME_strong_q31.c."""
    made, config = strong_q31.made, strong_q31.config
    strong, name = made.strong, made.name
    counted = ["SIGNALS", "CHANNELS", "INPUTS", "KINDS", "COLUMNS"]
    held = ", ".join("true" if one else "false" for one in (*strong.held, *[False] * len(strong.integrals)))
    names = [
        f"#define STRONG(verb) {name}_##verb##_q31",
        *(f"#define STRONG_{one} {name.upper()}_{one}" for one in counted),
        f"#define STRONG_P {len(made.parameters.p_bits)}u",
        f"#define STRONG_C {len(made.parameters.c_bits)}u",
        f"#define STRONG_HELD {int(any(strong.held))}",
        f"#define STRONG_HELD_CHANNELS {{{held}}}",
        f"#define STRONG_INTEGRANDS {len(strong.integrals)}",
        f"#define strong_model {name}_model_q31",
        f"#define strong_p_bits {name}_p_bits",
        f"typedef {name}_config_q31 strong_config_q31;",
        f"typedef {name}_q31 strong_q31;",
    ]
    signature = "static bool row(const int32_t in[], int32_t out[])"
    return "\n\n".join(
        [
            c_comment(banner(strong.functions, command)),
            f'#include "{name}_q31.h"\n\n#include <stddef.h>\n\n#include "number/integer_q31.h"\n'
            '#include "solve/kinds.h"\n#include "pvid/elementary_q31.h"',
            "\n".join(names),
            "/* From the sum of its filter to each input of the rows; from N, then Y, of each kind to the estimator's\n"
            " * formats. */\n" + _rescales("input", config.input) + "\n" + _rescales("entry", config.entry),
            "/* The kinds in theta and M. */\n" + structs("pvid_block", "blocks", _blocks(made)),
            *_filters(made),
            "/* N, then Y, of each kind. False iff an input is beyond its reach. */\n"
            + c_functions.fixed_function(signature, made.row, made.limits),
            *_integrals(strong_q31),
            parameters_in_c(made.parameters, name).rstrip(),
            '#include "strong/strong_q31.h"\n',
        ]
    )


def _filters(made: FixedStrong) -> list[str]:
    """What strong/strong_q31.h calls at the middle sample and at each tap, from the middle outwards."""
    begins, taps = [], []
    used: dict[str, str] = {}
    for k, one in enumerate(made.strong.sources):
        c, odd = one.channel, one.order % 2
        x = f"odd{c}" if odd else f"even{c}"
        used[x] = f"newer[{c}] - older[{c}]" if odd else f"(newer[{c}] - middle[{c}]) + (older[{c}] - middle[{c}])"
        begins.append(f"sum[{k}] = {'0' if one.order else f'pvid_product_q31(middle[{c}], centre)'};")
        place = f"{one.order}u * half" if one.order else "0"
        taps.append(f"sum[{k}] += pvid_product_q31(weight[{place}], {x});")
    unused = [] if any("middle" in one for one in begins) else ["(void)centre;", "(void)middle;"]
    differences = [f"const int32_t {x} = {text};" for x, text in used.items()]
    left = [f"(void){one};" for one in ("half", "middle") if not any(one in line for line in (*differences, *taps))]
    described = "; ".join(f"{k}: {one.meaning}" for k, one in enumerate(made.strong.functions.inputs))
    return [
        c_comment([f"The filters' sums at the middle sample. {described}."])
        + "\n"
        + c_functions.definition(
            "static inline void add_middle(int32_t centre, const int32_t middle[], int64_t sum[])", [*unused, *begins]
        ),
        "/* The same with the samples on either side; weight: that of order 0. */\n"
        + c_functions.definition(
            "static inline void add_tap(const PVID_TABLE int32_t *weight, size_t half, const int32_t middle[],"
            " const int32_t newer[], const int32_t older[], int64_t sum[])",
            [*left, *differences, *taps],
        ),
    ]


def _integrals(strong_q31: StrongQ31) -> list[str]:
    """What strong/strong_q31.h integrates."""
    made, config = strong_q31.made, strong_q31.config
    if made.integrands is None:
        return []
    places = sorted(config.raw.items())
    raw = [f"in[{k}] = pvid_rescaled_q31(counts[{place}], &raw[{at}]);" for at, (k, (place, _)) in enumerate(places)]
    signature = "static bool integrands(const int32_t in[], int32_t out[])"
    return [
        '#include "number/rescale_q31.h"',
        _rescales("raw", tuple(one for _, (_, one) in places))
        + "\n"
        + numbers("uint8_t", "integral_down", config.integral_down),
        "/* The inputs that are signals, from their counts. */\n"
        + c_functions.definition("static void raw_inputs(const int32_t counts[], int32_t in[])", raw),
        "/* Rates of the integrals. False iff an input is beyond its reach. */\n"
        + c_functions.fixed_function(signature, made.integrands, made.limits),
    ]


def design_header(strong_q31: StrongQ31, command: str) -> str:
    """NAME_strong_design_q31.h: a configuration that is ready for init."""
    config, made, name = strong_q31.config, strong_q31.made, strong_q31.name
    model, own = made.strong.functions.model, config.estimator
    units = {one.name: one.unit or "1" for one in model.signals}
    about = [
        f"{name}_design_q31.h - {model.title}: differentiators and settings of the strong form, integers only.",
        "",
        f"Generated by `{command}`: do not edit.",
        "",
        f"Derivatives over {config.window} samples, {config.window / config.sample_rate:.6g} s, for the instant "
        f"{config.delay} samples ago;",
        f"{config.sample_rate:.6g} samples a second, a solve at every {own.divider}.",
        "",
        "Readings [counts]:",
        *describe.table(
            [
                (f"reading[{k}]", one.name, f"{lsb:.6g} {units[one.name]} a count,", f"within +-{full}")
                for k, (one, lsb, full) in enumerate(
                    zip(made.strong.signals, strong_q31.lsb, config.full_scale, strict=True)
                )
            ]
        ),
        "",
        "Parameters:",
        *describe.table(
            [
                (
                    f"{one.name} [{one.unit or '1'}]",
                    f"= integer 2^-{bits},",
                    f"start {strong_q31.values(own.start)[k]:.6g},",
                    f"{strong_q31.values(own.lower)[k]:.6g} to {strong_q31.values(own.upper)[k]:.6g}",
                )
                for k, (one, bits) in enumerate(zip(model.unknowns, own.p_bits, strict=True))
            ]
        ),
        "",
        "The smallest sizes of the core that hold it, for little RAM:",
        f"  {' '.join(f'-D{macro}={size}' for macro, size in smallest(strong_q31.sizes).items())}",
    ]
    bank = {"half": config.half, "stride": config.stride, "centre": config.centre, "weights": f"{name}_weights_q31"}
    settings = {
        "bank": inner(bank),
        "full_scale": _listed(config.full_scale),
        "offset": _listed(config.offset),
        "shared": f"{name}_shared_q31" if config.shared is not None else "NULL",
        "rows_per_second": f"{config.rows_per_second}u",
        "gate": f"{{{', '.join(fields_of(config.gate))}}}",
        "estimator": "\n".join(["{", *(f"        {one}," for one in fields_of(own)), "    }"]),
    }
    body = [
        f'#include "{name}_q31.h"',
        "",
        *size_check({"PVID_MAX_WINDOW": config.memory}),
        "",
        numbers("PVID_TABLE int32_t", f"{name}_weights_q31", config.weights.ravel().tolist()),
        "",
        *([numbers("int32_t", f"{name}_shared_q31", config.shared), ""] if config.shared is not None else []),
        initialised(f"static const {name}_config_q31 {name}_config", settings),
        "",
    ]
    return guarded(f"{name}_design_q31", about, body)


def _listed(values: tuple[int, ...]) -> str:
    return f"{{{', '.join(map(str, values))}}}"


def _rescales(name: str, values: tuple[Rescale, ...]) -> str:
    return structs("pvid_rescale_q31", name, [(one.down, one.shift, one.multiplier) for one in values])


def _blocks(made: FixedStrong) -> list[tuple[int, int, int]]:
    """First entry, entries and first moment of each kind."""
    found, moments = [], 0
    for kind in made.strong.functions.kinds:
        n = len(kind.theta)
        found.append((kind.theta.start, n, moments))
        moments += n * (n + 1) // 2
    return found
