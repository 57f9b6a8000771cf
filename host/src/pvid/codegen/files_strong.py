"""The float32 files of a model's strong form: header and source of an identifier with samples in, parameters out.

The source prints what the model determines, and includes strong/strong_f32.h of the core, which is the same for all.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pvid.codegen import c_functions, describe
from pvid.codegen.c_functions import Language, c_literal, call_of, statements
from pvid.codegen.c_text import UNCONTRACTED, banner, c_comment, for_cpp, guarded
from pvid.codegen.functions import Function
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.strong_sums import Monomial, Noted, StrongSums, strong_sums_of, text_of
from pvid.model.operations import exact

_HEADER = """\
/* Settings. They must outlive the identifier, unchanged. */
typedef struct {{
    float sample_rate_hz;   /* 1e-3..1e6 [Hz] */
    pvid_fir_bank_f32 bank; /* of all derivatives, see pvid/differentiator.h; five points are written out */
    float row_sd[{upper}_KINDS]; /* standard deviation of Y - N^T theta of each kind of row [unit of its Y], > 0 */
    pvid_gate_config_f32 gate;   /* outlier gate on the weighted innovations of an instant; zeros: none */
    const float *shared;    /* what no row shows, derivatives' bias above all: as of pvid/trust.h, added to the standard
                               errors. NULL: none. Must outlive the identifier */
    uint16_t exact_every;   /* rows from one exact projection to the next if divider is 1, 1..255; 0: 8, with the law
                               pseudovelocity 1 */
    pvid_estimator_config_f32 estimator; /* start, bounds, law ..; model, row_sd, update_rate_hz, noise_margin,
                                            row_weight are ignored; no dead zone */
}} {name}_config_f32;

/* State; only the functions below write to it. The last samples of all channels: */
typedef struct {{
    float scale[PVID_ORDERS]; /* factors of the filters' sums [1/s^k] */
    uint16_t length;          /* places of the ring */
    uint16_t stride;          /* places from tap to tap */
    uint16_t head;            /* place of the oldest point */
    uint16_t at;              /* samples in a point that is not complete */
    uint16_t missing;         /* points until the window is full */
    uint8_t before;           /* samples in `past` */
    uint8_t five_points;      /* 1: the bank is pvid_five_points_f32; 2: and the window is full */
{past}    float points[PVID_MAX_WINDOW][{upper}_CHANNELS];
}} {name}_window_f32;

/* Sums, parameters, the equations of the next step. */
typedef struct {{
    const {name}_config_f32 *config; /* NULL before init has accepted one */
    float p[{upper}_P];      /* the estimate */
    float s[{triangle}];           /* S at the last exact projection and the rows since, upper triangle by rows */
    float force[{upper}_P];  /* right-hand side of the next step */
    float prior[{upper}_P];  /* diagonal of H0 */
    float weight[{upper}_KINDS]; /* of each kind, relative to the first */
    float row_sd;            /* of the first kind, in units of the core's rows */
    float gain;              /* gamma of a step with an exact projection */
    float retention;         /* factor on the past at a fold, in (0, 1] */
    uint16_t phase;          /* rows since the last projection */
    uint8_t exact_every;
    uint8_t staged;          /* 1: projection, solve and fold at rows of their own */
    uint8_t fold_every;      /* rows between folds */
    uint8_t age;             /* rows in the sums since the last fold */
    uint8_t in_block;        /* rows in `block` */
    bool mixes;              /* gain < 1 */
    pvid_p_bits pinned;      /* bit a: p[a] stays at its bound until the next projection, */
    pvid_p_bits blocked;     /* because the last one would have moved it outwards */
    pvid_counters counters;
    float block[4][{upper}_ATOMS]; /* rows that are not in the sums yet, and the present one */
    float high[{upper}_SUMS];      /* the value of a sum is high + low */
    float low[{upper}_SUMS];
}} {name}_estimator_f32;

typedef struct {{
    {name}_window_f32 window;
    bool frozen;
    bool alarm; /* the last block of rows was a misfit: see pvid/misfit.h */
{integrals}    pvid_gate_f32 gate;
    pvid_misfit_f32 misfit;
    {name}_estimator_f32 estimator; /* p and counters */
}} {name}_f32;

/* The init below, for an application with this word (pvid/layout.h). */
pvid_status {name}_init_layout_f32({name}_f32 *self, const {name}_config_f32 *config, uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library, this model and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged), or
 *   - the bank, the rate or another setting is out of its range (the status names it). */
static inline pvid_status {name}_init_f32({name}_f32 *self, const {name}_config_f32 *config)
{{
    return {name}_init_layout_f32(self, config, PVID_LAYOUT);
}}

/* One sample of each signal, in the order of {upper}_SIGNALS above. Returns
 *   - PVID_WARMING_UP until the window is full, PVID_ACCUMULATED within a point or between solves,
 *   - PVID_REJECTED_NOT_FINITE for a sample that is not finite: it restarts the window, the sums are kept,
 *   - PVID_REJECTED_OUTLIER for an instant that the gate rejects, PVID_REJECTED_SATURATED for one beyond the limit of
 *     a row, PVID_HELD_FROZEN while frozen,
 *   - PVID_MISFIT instead of PVID_UPDATED during the alarm of pvid/misfit.h: do not trust the estimate,
 *   - PVID_HELD_NOT_EXCITED or PVID_HELD_SINGULAR where the rows do not determine p, else PVID_UPDATED. */
pvid_reason {name}_step_f32({name}_f32 *self, const float sample[{upper}_SIGNALS]);

/* The same for inputs of one instant that you have differentiated yourself, in the order of {upper}_INPUTS above. */
pvid_reason {name}_row_step_f32({name}_f32 *self, const float in[{upper}_INPUTS]);

/* Standard errors, kappa and residual of the present p. Cost: about two solves. */
void {name}_assess_f32(const {name}_f32 *self, pvid_estimate_f32 *estimate);

/* Writes the values of the sums, without the rows of an unfinished block. */
void {name}_read_sums_f32(const {name}_f32 *self, float sums[{upper}_SUMS]);

/* The running hash of pvid/fnv.h: continues hash after a tick with this reason. */
uint32_t {name}_fnv_f32(uint32_t hash, const {name}_estimator_f32 *estimator, pvid_reason reason);

/* Call this when samples are missing: the window restarts, all other state is kept. */
void {name}_gap_f32({name}_f32 *self);

/* Freezes the identifier (true) or resumes it (false). While frozen p and the sums are kept without forgetting. */
void {name}_freeze_f32({name}_f32 *self, bool frozen);"""

_INTEGRATE = """\
/* The samples and the integrals since the start of the run by the trapezoid rule; a missing sample repeats the one
 * before. */
static const float *integrate(strong_f32 *self, const float sample[STRONG_SIGNALS], bool finite)
{{
    float rate[{count}];
    memcpy(rate, self->integrand, sizeof rate);
    if (finite) {{
        float in[STRONG_INPUTS] = {{0.0f}};
{places}
        integrands(in, rate);
    }}
    for (size_t i = 0; i < {count}u; i++) {{
        const float before = self->is_running ? self->integrand[i] : rate[i];
        if (self->is_running) {{
            self->integral[i] += self->half_period * (before + rate[i]);
        }}
        self->integrand[i] = rate[i];
        self->now[STRONG_SIGNALS + i] = self->integral[i];
    }}
    memcpy(self->now, sample, STRONG_SIGNALS * sizeof sample[0]);
    self->is_running = self->is_running || finite;
    return self->now;
}}
#define STRONG_WITH_INTEGRALS(self, sample, finite) integrate(self, sample, finite)
#define STRONG_PREPARE_INTEGRALS(self, config) ((self)->half_period = 0.5f / (config)->sample_rate_hz)"""

_NO_INTEGRALS = """\
#define STRONG_WITH_INTEGRALS(self, sample, finite) (sample)
#define STRONG_PREPARE_INTEGRALS(self, config) ((void)0)"""

# Five points written out, the oldest first: sums of order 1 .. 4.
_FIVE = (
    "(8.0f * ({x}[3] - {x}[1])) - ({x}[4] - {x}[0])",
    "(16.0f * (({x}[3] - {x}[2]) + ({x}[1] - {x}[2]))) - (({x}[4] - {x}[2]) + ({x}[0] - {x}[2]))",
    "({x}[4] - {x}[0]) - (2.0f * ({x}[3] - {x}[1]))",
    "(({x}[4] - {x}[2]) + ({x}[0] - {x}[2])) - (4.0f * (({x}[3] - {x}[2]) + ({x}[1] - {x}[2])))",
)


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_strong.h and NAME_strong_f32.c, where they are chosen."""
    if not model.options.strong:
        return {}
    return files_of(model.strong, model.command)


def files_of(strong: StrongFunctions, command: str) -> dict[str, str]:
    """The same of a strong form, which has the name NAME_strong."""
    name = strong.functions.name
    return {f"{name}.h": header(strong, command), f"{name}_f32.c": source(strong, command)}


def sizes_of(strong: StrongFunctions) -> dict[str, int]:
    """Of the core's arrays, but for the window."""
    model = strong.functions.model
    tied = {"PVID_MAX_CONSTRAINTS": len(model.constraints)} if model.constraints else {}
    return {"PVID_MAX_P": len(model.unknowns), **tied}


def header(strong: StrongFunctions, command: str) -> str:
    """NAME_strong.h; `strong` has the name NAME_strong."""
    functions, sums = strong.functions, strong_sums_of(strong)
    name, upper = functions.name, functions.name.upper()
    n_p = len(functions.model.unknowns)
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
        "How often p is solved for: divider 1: a step at every row, from all sums at every exact_every-th (by default",
        "every eighth, with pseudovelocity each); divider 8, 12 .. 64: projection, solve and folding of the sums at",
        "rows of their own, the least work of a tick; other dividers: all at one row. The paper's law (5) is",
        "pseudovelocity with divider 1.",
        "",
        "Samples:",
        *describe.table(samples),
        "",
        f"The library must be compiled with {' and '.join(f'{a} >= {b}' for a, b in sizes_of(strong).items())}.",
        "Not thread-safe. Never allocates.",
        "",
        *describe.everything(functions),
    ]
    counts = {
        "P": n_p,
        "KINDS": len(functions.kinds),
        "SIGNALS": len(strong.signals),
        "CHANNELS": strong.channels,
        "INPUTS": len(functions.inputs),
        "ATOMS": len(sums.atoms),
        "SUMS": len(sums.places),
    }
    past = (
        f"    float past[{upper}_CHANNELS][3]; /* of the samples, around a held input */\n" if any(strong.held) else ""
    )
    integrals = ""
    if strong.integrals:
        counts["INTEGRANDS"] = len(strong.integrals)
        integrals = (
            f"    float now[{upper}_CHANNELS]; /* of all channels */\n"
            f"    float integral[{upper}_INTEGRANDS]; /* since the start of the run */\n"
            f"    float integrand[{upper}_INTEGRANDS];\n    float half_period;\n    bool is_running;\n"
        )
    text = _HEADER.format(name=name, upper=upper, past=past, integrals=integrals, triangle=f"{n_p * (n_p + 1) // 2}")
    body = [
        '#include "pvid/detail/p_bits.h"',
        '#include "pvid/differentiator.h"',
        '#include "pvid/estimator.h"',
        '#include "pvid/gate.h"',
        '#include "pvid/misfit.h"',
        "",
        *(
            line
            for macro, size in sizes_of(strong).items()
            for line in (
                f"#if {macro} < {size}",
                f'#error "compile pvid and this file with -D{macro}={size}"',
                "#endif",
            )
        ),
        "",
        *for_cpp([*(f"#define {upper}_{what} {count}" for what, count in counts.items()), "", text, ""]),
    ]
    return guarded(name, about, body)


def source(strong: StrongFunctions, command: str) -> str:
    """NAME_strong_f32.c."""
    functions, sums = strong.functions, strong_sums_of(strong)
    name = functions.name
    parts = [
        c_comment(banner(functions, command)),
        UNCONTRACTED,
        _includes(name),
        _names(strong, sums),
        *_inputs(strong),
        *_rows(sums),
        *_equations(sums),
        *_integrals(strong),
        *_constraints(strong),
        '#include "strong/strong_f32.h"',
    ]
    return "\n\n".join(parts) + "\n"


def _includes(name: str) -> str:
    own = ["number/finite_f32.h", "number/unroll.h", "pvid/elementary.h", "solve/cholesky_f32.h"]
    own += ["strong/block_f32.h", "strong/differentiator_f32.h"]
    standard = ["math.h", "stdbool.h", "stddef.h", "string.h"]
    groups = [f'#include "{name}.h"'], [f"#include <{one}>" for one in standard], [f'#include "{one}"' for one in own]
    return "\n\n".join("\n".join(one) for one in groups)


def _names(strong: StrongFunctions, sums: StrongSums) -> str:
    """What strong/strong_f32.h is given."""
    name, upper = strong.functions.name, strong.functions.name.upper()
    n_p = len(sums.p)
    units = ", ".join(c_literal(1 / exact(one.unit)) for one in sums.kinds)
    linear = ", ".join(map(str, sums.linear)) or "0"
    held = ", ".join("1" if one else "0" for one in (*strong.held, *([False] * len(strong.integrals))))
    counted = ["P", "KINDS", "SIGNALS", "CHANNELS", "INPUTS", "ATOMS", "SUMS"]
    positive = sum(one.positive << k for k, one in enumerate(strong.functions.model.unknowns))
    return "\n".join(
        [
            f"#define STRONG(verb) {name}_##verb##_f32",
            *(f"#define STRONG_{one} {upper}_{one}" for one in counted),
            f"#define STRONG_WEIGHT {sums.places[()]}u",
            f"#define STRONG_S {n_p * (n_p + 1) // 2}",
            f"#define STRONG_POSITIVE {positive}u",
            f"#define STRONG_HELD {int(any(strong.held))}",
            f"#define STRONG_CONSTRAINTS {len(strong.functions.model.constraints)}",
            f"#define STRONG_HELD_CHANNELS {{{held}}}",
            "/* rows below are those of the header times these */",
            f"#define STRONG_UNITS {{{units}}}",
            f"#define STRONG_LINEAR {{{linear}}}",
            f"#define STRONG_LINEAR_COUNT {len(sums.linear)}u",
            "#define STRONG_FIVE_POINTS_READY 2u",
            *(f"typedef {name}_{one}_f32 strong_{one}_f32;" for one in ("config", "window", "estimator")),
            f"typedef {name}_f32 strong_f32;",
            "",
            "/* Residual e = Y - N^T theta and gradient g = C^T N of a row of each kind. */",
            "typedef struct {",
            "    float e[STRONG_KINDS];",
            "    float g[STRONG_KINDS][STRONG_P];",
            "} strong_gradient_f32;",
        ]
    )


def _inputs(strong: StrongFunctions) -> list[str]:
    five, bank = [], []
    for k, one in enumerate(strong.sources):
        x = f"x[{one.channel}]"
        held = one.channel < len(strong.signals) and strong.held[one.channel]
        if one.order:
            five.append(f"in[{k}] = ({_FIVE[one.order - 1].format(x=x)}) * scale[{one.order}];")
            bank.append(f"in[{k}] = sums[{one.channel}].sum[{one.order}] * scale[{one.order}];")
        else:
            mean = f"((13.0f * ({x}[1] + {x}[2])) - ({x}[0] + {x}[3])) / 24.0f"
            five.append(f"in[{k}] = {mean if held else f'{x}[2]'};")
            bank.append(f"in[{k}] = (sums[{one.channel}].middle + sums[{one.channel}].sum[0]) * scale[0];")
    scaled = any(one.order for one in strong.sources)
    described = "; ".join(f"in[{k}]: {one.meaning}" for k, one in enumerate(strong.functions.inputs))
    return [
        _commented(
            f"The inputs of a row from five points of each channel, the oldest first. {described}.",
            c_functions.definition(
                "static inline void inputs_of_five(const float x[STRONG_CHANNELS][5], const float scale[PVID_ORDERS],"
                " float in[STRONG_INPUTS])",
                [*five, *([] if scaled else ["(void)scale;"])],
            ),
        ),
        _commented(
            "The same from the sums of a bank of filters.",
            c_functions.definition(
                "static inline void inputs_of_bank(const pvid_fir_sums_f32 sums[STRONG_CHANNELS],"
                " const float scale[PVID_ORDERS], float in[STRONG_INPUTS])",
                bank,
            ),
        ),
    ]


def _rows(sums: StrongSums) -> list[str]:
    innovation = sums.innovation
    lines, results = _printed(innovation.noted)
    at = iter(results)
    entries: list[str] = []
    squares: list[str] = []
    forces: dict[int, list[str]] = {a: [] for a in range(len(sums.p))}
    place = _triangle(len(sums.p))
    for k, own in enumerate(innovation.entries):
        entries.append(f"row->e[{k}] = {next(at)};")
        entries += [f"row->g[{k}][{a}] = {next(at)};" for a in own]
        names = {a: f"row->g[{k}][{a}]" for a in own}
        weighted = {a: f"q{k}_{a}" for a in own} if k else names
        if k:
            squares += [f"const float {weighted[a]} = weight[{k}] * {names[a]};" for a in own]
        squares += [f"s[{place[a, b]}] += {weighted[a]} * {names[b]};" for a in own for b in own if b >= a]
        for a in own:
            g = f"(weight[{k}] * {names[a]})" if k else names[a]
            forces[a].append(f"({g} * row->e[{k}])")
    force = [f"force[{a}] = {' + '.join(terms) or '0.0f'};" for a, terms in forces.items()]
    bound, (limited,) = _printed(Noted(sums.bound, {}))
    several = len(sums.kinds) > 1
    unused = [] if several else ["(void)weight;"]
    kinds = range(len(sums.kinds))
    square = " + ".join(
        f"(weight[{k}] * (row->e[{k}] * row->e[{k}]))" if k else "(row->e[0] * row->e[0])" for k in kinds
    )
    sensitive = [k for k in kinds if 0 in innovation.entries[k]]
    unit = "p[0] * " if sums.strong.functions.model.unknowns[0].positive else ""
    parts = [f"const float r{k} = {unit}row->g[{k}][0];" for k in sensitive]
    signal = " + ".join(f"(weight[{k}] * (r{k} * r{k}))" if k else f"(r{k} * r{k})" for k in sensitive) or "0.0f"
    atoms, atom_results = _printed(Noted(sums.atoms_program, {}))
    listed = "; ".join(f"x[{k}] = {one}" for k, one in enumerate(sums.atoms))
    return [
        _commented(
            f"The factors of the rows: {listed}.",
            c_functions.definition(
                "static inline void atoms_of(const float in[STRONG_INPUTS], float x[STRONG_ATOMS])",
                [*atoms, *(f"x[{k}] = {one};" for k, one in enumerate(atom_results))],
            ),
        ),
        _commented(
            "A bound of the squares of all entries of the rows.",
            c_functions.definition(
                "static inline float bound_of(const float x[STRONG_ATOMS])",
                [*_unused([*bound, limited], ("x",)), *bound, f"return {limited};"],
            ),
        ),
        _commented(
            [
                "e = Y - P and g of each kind of row, for theory.md (5). P = N^T theta is (2), g = dP/dp = C^T N with C"
                " of (4); each term of P, in powers of x and p, is an entry of N times its theta. z_2 is the second"
                " derivative of a signal z.",
                *([f"With {sums.shift_text}:"] if sums.shift_text else []),
                *(f"  {line}" for k in kinds for line in sums.about(k)),
                f"{innovation.program.cost}.",
            ],
            c_functions.definition(
                "static inline void innovate(const float p[STRONG_P], const float x[STRONG_ATOMS],"
                " strong_gradient_f32 *row)",
                [*_unused(lines, ("p",)), *lines, *entries],
            ),
        ),
        _commented(
            "s += C^T N (C^T N)^T, the upper triangle by rows.",
            c_functions.definition(
                "static inline void add_squares(const strong_gradient_f32 *row, const float weight[STRONG_KINDS],"
                " float s[STRONG_S])",
                [*unused, *squares],
            ),
        ),
        _commented(
            "C^T N e, the right-hand side of (5).",
            c_functions.definition(
                "static inline void force_of(const strong_gradient_f32 *row, const float weight[STRONG_KINDS],"
                " float force[STRONG_P])",
                [*unused, *force],
            ),
        ),
        _commented(
            "The square of the innovations.",
            c_functions.definition(
                "static inline float square_of(const strong_gradient_f32 *row, const float weight[STRONG_KINDS])",
                [*unused, f"return {square};"],
            ),
        ),
        _commented(
            "The square of p[0] dY/dp[0], see pvid/misfit.h.",
            c_functions.definition(
                "static inline float signal_of(const strong_gradient_f32 *row, const float weight[STRONG_KINDS],"
                " const float p[STRONG_P])",
                [*_unused([*parts, signal], ("weight", "p")), *parts, f"return {signal};"],
            ),
        ),
    ]


def _equations(sums: StrongSums) -> list[str]:
    n_p = len(sums.p)
    lines, results = _printed(sums.noted_projection)
    triangle = n_p * (n_p + 1) // 2
    projected = [f"s[{k}] = {one};" for k, one in enumerate(results[:triangle])]
    projected += [f"force[{a}] = {one};" for a, one in enumerate(results[triangle:])]
    arguments = "const float high[STRONG_SUMS], const float low[STRONG_SUMS], const float p[STRONG_P],"
    arguments += " const float weight[STRONG_KINDS]"
    distance, (apart,) = _printed(Noted(sums.distance, {}))
    signature = "static PVID_NOINLINE void add_rows(const float block[restrict][STRONG_ATOMS],"
    signature += " float low[restrict STRONG_SUMS])"
    return [
        _commented(
            f"The rows of a block to the {len(sums.places)} sums of M, B and Y^2: each product by one multiplication.",
            c_functions.definition(signature, _added_products(sums)),
        ),
        _commented(
            "S = C^T M C of theory.md (5) and F = C^T (B - M theta) of (6) at p: sums of g g^T and g e."
            f" {sums.projection.cost}.",
            c_functions.definition(
                f"PVID_ALWAYS_INLINE void project({arguments}, float s[STRONG_S], float force[STRONG_P])",
                [*_unused(lines, ("p", "weight")), *lines, *projected],
            ),
        ),
        _commented(
            "The sum of (Y - Q)^2, Q the part of P behind its terms p g.",
            c_functions.definition(
                f"static PVID_COLD float distance({arguments})",
                [*_unused(distance, ("high", "low", "p", "weight")), *distance, f"return {apart};"],
            ),
        ),
        _commented(
            "dp = (S + H0)^-1 rhs, theory.md (5) and (6), by L D L^T from the last row up: d is the diagonal,"
            " v are the pivots. Fails iff a pivot is below PVID_PIVOT_MIN of its"
            " diagonal (PVID_HELD_SINGULAR), or p[0] is not sufficiently excited (PVID_HELD_NOT_EXCITED).",
            c_functions.definition(
                "PVID_ALWAYS_INLINE pvid_reason solved(const float s[STRONG_S], const float prior[STRONG_P],"
                " float kappa_min, const float rhs[STRONG_P], float dp[STRONG_P])",
                _solve(n_p),
            ),
        ),
    ]


def _integrals(strong: StrongFunctions) -> list[str]:
    if not strong.integrals:
        return [_NO_INTEGRALS]
    functions = strong.functions
    places = [
        f"        in[{k}] = sample[{place}];"
        for k, one in enumerate(functions.inputs)
        if (place := strong.raw_places(one)) is not None
    ]
    count = len(strong.integrals)
    inner: Function = functions.integrands
    signature = f"static void integrands(const float in[STRONG_INPUTS], float out[{count}])"
    return [
        c_functions.float_function(signature, inner.program),
        _INTEGRATE.format(count=count, places="\n".join(places)),
    ]


def _constraints(strong: StrongFunctions) -> list[str]:
    """What the elimination of theory.md (6b) is given."""
    function = strong.functions.constraints
    if not function.labels:
        return []
    signature = "static void constraints(const float in[], float out[])"
    count = len(strong.functions.model.constraints)
    return [
        _commented(
            f"Each constraint h(p) = 0 and its derivatives by p, theory.md (6b): {'; '.join(function.labels)}.",
            c_functions.float_function(signature, function.program),
        ),
        "static const pvid_model_f32 tied = {"
        f".n_p = STRONG_P, .n_constraints = {count}u, .constraints = constraints}};",
    ]


def _added_products(sums: StrongSums) -> list[str]:
    """A multiplication, four additions, a load and a store for each sum."""
    names: dict[Monomial, str] = {((a, 1),): f"a{a}" for a in range(len(sums.atoms))}
    rows = [f"block[0][{a}], block[1][{a}], block[2][{a}], block[3][{a}]" for a in range(len(sums.atoms))]
    lines = [f"const pvid_four_f32 a{a} = {{{row}}};" for a, row in enumerate(rows)]

    def add(monomial: Monomial) -> None:
        if monomial in sums.places:
            place = sums.places[monomial]
            lines.append(f"low[{place}] = pvid_four_added_f32(low[{place}], {names[monomial]});")

    for monomial in list(names):
        add(monomial)
    for one in sums.chains:
        names[one.made] = "m" + "_".join(f"{a}x{k}" for a, k in one.made)
        factors = f"{names[one.left]}, {names[one.right]}"
        lines.append(
            f"const pvid_four_f32 {names[one.made]} = pvid_four_times_f32({factors}); /* {text_of(one.made)} */"
        )
        add(one.made)
    return [*lines, f"low[{sums.places[()]}] += (float)PVID_STRONG_ROWS;"]


def _solve(n_p: int) -> list[str]:
    place = _triangle(n_p)
    last = n_p - 1
    lines = []
    for b in reversed(range(n_p)):
        lines.append(f"const float d{b} = s[{place[b, b]}] + prior[{b}];")
        if b == last:
            lines += [f"if (!pvid_positive_normal_f32(d{b})) {{", "    return PVID_HELD_SINGULAR;", "}"]
        else:
            lines.append(f"const float sum{b} = {f'sum{b + 1}' if b + 1 < last else f'd{last}'} + d{b};")
        pivot = f"d{b}"
        for k in range(b + 1, n_p):
            pivot = f"({pivot} - (l{b}_{k} * c{b}_{k}))"
        lines.append(f"const float v{b} = {pivot};")
        if b < last:
            lines += [f"if (!pvid_pivot_is_significant_f32(v{b}, d{b})) {{", "    return PVID_HELD_SINGULAR;", "}"]
        lines.append(f"const float i{b} = 1.0f / v{b};")
        for a in reversed(range(b)):
            c = f"s[{place[a, b]}]"
            for k in range(b + 1, n_p):
                c = f"({c} - (l{a}_{k} * c{b}_{k}))"
            lines += [f"const float c{a}_{b} = {c};", f"const float l{a}_{b} = c{a}_{b} * i{b};"]
    if last:
        lines += [
            "/* infinity and NaN of any show in the sum; others that are not positive in their pivots */",
            "if (!pvid_positive_normal_f32(sum0)) {",
            "    return PVID_HELD_SINGULAR;",
            "}",
        ]
    lines += [
        "const bool own = (v0 >= (2.0f * prior[0])) || !(kappa_min > 0.0f);",
        "if (!(v0 >= (kappa_min * d0)) || !own) {",
        "    return PVID_HELD_NOT_EXCITED;",
        "}",
    ]
    for a in reversed(range(n_p)):
        z = f"rhs[{a}]"
        for k in range(a + 1, n_p):
            z = f"({z} - (l{a}_{k} * z{k}))"
        lines.append(f"const float z{a} = {z};")
    for a in range(n_p):
        x = f"(z{a} * i{a})"
        for k in range(a):
            x = f"({x} - (l{k}_{a} * dp[{k}]))"
        lines.append(f"dp[{a}] = {x};")
    return [*lines, "return PVID_UPDATED;"]


def _triangle(n_p: int) -> dict[tuple[int, int], int]:
    pairs = [(a, b) for a in range(n_p) for b in range(a, n_p)]
    return {pair: place for place, pair in enumerate(pairs)}


_ARRAYS = {"p": "p[{}]", "x": "x[{}]", "in": "in[{}]", "w": "weight[{}]", "s": "high[{0}] + low[{0}]"}


def _argument(name: str) -> str:
    stem = name.rstrip("0123456789")
    return _ARRAYS[stem].format(name.removeprefix(stem))


def _printed(noted: Noted) -> tuple[list[str], list[str]]:
    """The statements of a program whose arguments are places of arrays, and its results."""
    program = noted.program
    names = c_functions.names_of(program)
    notes = {names[place]: f" /* {text} */" for place, text in noted.notes.items()}
    language = Language(
        statement=lambda name, text: f"const float {name} = {text};{notes.get(name, '')}",
        argument=lambda place: _argument(program.arguments[place]),
        literal=lambda place: c_literal(program.literal(place)),
        operation=lambda place, operands: call_of(program, place, operands, c_functions.FLOAT_CALLS),
    )
    return statements(program, language)


def _unused(lines: Sequence[str], arrays: Sequence[str]) -> list[str]:
    """Statements for those of the arrays that the lines do not use."""
    text = " ".join(lines)
    return [f"(void){one};" for one in arrays if re.search(rf"\b{one}\[", text) is None]


def _commented(comment: str | list[str], text: str) -> str:
    return f"{c_comment([comment] if isinstance(comment, str) else comment)}\n{text}"
