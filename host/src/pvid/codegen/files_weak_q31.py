"""The fixed-point files of a model's weak form for pvid/weak_q31.h: the model, and a design for a rig."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields

from pvid.codegen import describe
from pvid.codegen.c_functions import fixed_function, scaled_function
from pvid.codegen.c_text import array, banner, c_comment, for_cpp, guarded
from pvid.codegen.files_weak import shared_errors, size_check
from pvid.codegen.fitted_sizes import config_header, fitted_sizes_q31
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak_q31 import FixedWeak, ParametersQ31, WeakQ31
from pvid.codegen.weak_sizes import sizes_of_q31
from pvid.core.sizes import smallest
from pvid.settings.parts import EstimatorConfigQ31, GateConfigQ31, TrustConfigQ31
from pvid.settings.weak import NONE
from pvid.settings.weak_q31 import WeakConfigQ31, WeakDesignQ31

_WIDTH = 12  # numbers a line


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_weak_q31.h and .c, NAME_design_q31.h and NAME_config_q31.h, where there is a rig."""
    weak = model.options.weak_q31_for_run
    if weak is None:
        return {}
    name = f"{weak.name}_config_q31"
    return files_of(weak, model.command) | {f"{name}.h": config_header(name, fitted_of(weak), model.command)}


def files_of(weak: WeakQ31, command: str) -> dict[str, str]:
    """NAME_weak_q31.h and .c, NAME_design_q31.h.

    Parameters
    ----------
    command : that makes them; no date, so that the same command makes the same files
    """
    sizes, name = sizes_of(weak), weak.name
    return {
        f"{name}_weak_q31.h": header(weak.made, sizes, command),
        f"{name}_weak_q31.c": source(weak.made, weak.parameters, command),
        f"{name}_design_q31.h": design_header(
            weak.config, name, sizes, command, [*_about(weak), *shared_errors(weak.config.causes)]
        ),
    }


def fitted_of(weak: WeakQ31) -> dict[str, int]:
    """Sizes of the core for this design alone."""
    model = weak.parameters.model
    return fitted_sizes_q31(weak.config, model.n_p, len(model.c_row))


def sizes_of(weak: WeakQ31) -> dict[str, int]:
    """Sizes of the core that hold this design."""
    model = weak.parameters.model
    return sizes_of_q31(weak.config.design, model.n_p, len(model.c_row))


def header(made: FixedWeak, needed: Mapping[str, int], command: str) -> str:
    """NAME_weak_q31.h.

    Parameters
    ----------
    needed : sizes of the core that the model needs (pvid.codegen.weak_sizes)
    """
    own = made.functions
    name = own.name
    units = {one.name: one.unit or "1" for one in own.model.signals}
    about = [
        f"{name}_weak_q31.h - {own.model.title}: the weak form for pvid/weak_q31.h, integers only.",
        "",
        *banner(own.functions, command),
        "",
        f'  #include "{name}_design_q31.h"',
        "  static pvid_weak_q31 identifier;",
        f"  if (pvid_weak_init_q31(&identifier, &{name}_config_q31) != PVID_OK) ...",
        "  each tick: reason = pvid_weak_step_q31(&identifier, reading);",
        "",
        "Its formats are those of a rig: the reach of each derivative. Readings of a tick, in counts:",
        *describe.table([(f"reading[{k}]", one, f"[{units[one]}]") for k, one in enumerate(own.samples)]),
        "",
        *describe.everything(own.functions),
    ]
    body = [
        '#include "pvid/weak_q31.h"',
        "",
        *size_check(needed),
        "",
        *for_cpp(
            [
                "/* Tables of channels and terms, and the functions of the equations. */",
                f"extern const pvid_weak_model_q31 {name}_weak_q31;",
                "",
            ]
        ),
    ]
    return guarded(f"{name}_weak_q31", about, body)


def source(made: FixedWeak, parameters: ParametersQ31, command: str) -> str:
    """NAME_weak_q31.c."""
    name = made.functions.name
    return "\n\n".join(
        [
            c_comment(banner(made.functions.functions, command)),
            f'#include "{name}_weak_q31.h"\n\n#include <stddef.h>\n\n#include "pvid/elementary_q31.h"',
            _functions(made, name).rstrip(),
            parameters_in_c(parameters, name).rstrip(),
            *(one for one in _model(made, name) if one),
            "",
        ]
    )


def together(made: FixedWeak, parameters: ParametersQ31, design: WeakDesignQ31, prefix: str) -> str:
    """Functions, PREFIX_weak_q31 and PREFIX_design_q31 in one text, for proofs."""
    return "\n\n".join(
        [
            '#include "pvid/weak_q31.h"\n#include "pvid/elementary_q31.h"\n\n#include <stddef.h>',
            _functions(made, prefix).rstrip(),
            parameters_in_c(parameters, prefix).rstrip(),
            *_model(made, prefix),
            *_design(design, prefix),
        ]
    )


def design_header(
    config: WeakConfigQ31, name: str, needed: Mapping[str, int], command: str, about: Sequence[str]
) -> str:
    """NAME_design_q31.h: tables of a rig, and a configuration that is ready for init.

    Parameters
    ----------
    needed : sizes of the core that the design needs
    about : what the rig, the settings and the shared errors are, lines; the text of a log does not have them
    """
    opening = [
        f"{name}_design_q31.h - tables and settings of the weak form for a rig, integers only.",
        "",
        f"Generated by `{command}`: do not edit.",
        "",
        *about,
        "",
        "The smallest sizes of the core that hold it, for little RAM:",
        f"  {' '.join(f'-D{macro}={size}' for macro, size in smallest(needed).items())}",
    ]
    body = [
        "#include <stddef.h>",
        "",
        f'#include "{name}_weak_q31.h"',
        "",
        *size_check(needed),
        "",
        "\n\n".join([*_design(config.design, name), configuration(config, name)]),
        "",
    ]
    return guarded(f"{name}_design_q31", opening, body)


def _place(place: int) -> str:
    return "PVID_WEAK_NONE" if place == NONE else str(place)


def structs(kind: str, name: str, entries: Iterable[Sequence[object]]) -> str:
    """A constant array of structs; "" of none."""
    lines = [f"    {{{', '.join(map(str, one))}}}," for one in entries]
    return "\n".join([f"static const {kind} {name}[{len(lines)}] = {{", *lines, "};"]) if lines else ""


def numbers(kind: str, name: str, values: Iterable[int]) -> str:
    """A constant array of integers; "" of none."""
    return array(kind, name, map(int, values), _WIDTH)


def _model(made: FixedWeak, prefix: str) -> list[str]:
    model = made.model
    channels = [
        (_place(one.gain), _place(one.integrand), one.fold, _place(one.plain), _place(one.ramp))
        for one in model.channel
    ]
    kinds = [(one.thetas, one.nuisances, one.first, one.end) for one in model.kind]
    counts = {
        "samples": model.samples,
        "signals": len(model.signal),
        "jets": len(model.jet),
        "runs": model.runs,
        "signs": model.signs,
        "gains": model.gains,
        "integrands": model.integrands,
        "channels": len(model.channel),
        "kinds": len(model.kind),
    }
    tables = ("signal", "jet", "channel", "term", "kind")
    struct = [
        f"const pvid_weak_model_q31 {prefix}_weak_q31 = {{",
        *(f"    .{name} = {count}," for name, count in counts.items()),
        *(f"    .{name} = {prefix}_{name}," for name in tables),
        f"    .prepare = {prefix + '_prepare_q31' if made.prepare else 'NULL'},",
        f"    .values = {prefix}_values_q31,",
        f"    .model = &{prefix}_model_q31,",
        "};",
    ]
    return [
        structs("pvid_weak_signal", f"{prefix}_signal", [(one.sample, int(one.source)) for one in model.signal]),
        structs("pvid_weak_jet", f"{prefix}_jet", [(one.signal, one.order) for one in model.jet]),
        structs("pvid_weak_channel", f"{prefix}_channel", channels),
        structs("pvid_weak_term_q31", f"{prefix}_term", [(x.channel, x.order, x.column) for x in model.term]),
        structs("pvid_weak_kind", f"{prefix}_kind", kinds),
        "\n".join(struct),
    ]


def _design(design: WeakDesignQ31, prefix: str) -> list[str]:
    parts, filters = [], []
    for k, one in enumerate(design.filter):
        weights = f"{prefix}_weights_{k}_q31"
        parts.append(numbers("PVID_TABLE int32_t", weights, one.weights))
        filters.append((one.half, one.down, weights))
    formats = [(one.value, one.lift, one.own, one.plain, one.ramp) for one in design.format]
    tables = {
        "full_scale": numbers("int32_t", f"{prefix}_full_scale_q31", design.full_scale),
        "down": numbers("uint8_t", f"{prefix}_down_q31", design.down),
        "filter": structs("pvid_weak_filter_q31", f"{prefix}_filter_q31", filters),
        "run": structs("pvid_rescale_q31", f"{prefix}_run_q31", [(x.down, x.shift, x.multiplier) for x in design.run]),
        "sign_width": numbers("int32_t", f"{prefix}_sign_width_q31", design.sign_width),
        "integral": structs("pvid_weak_integral_q31", f"{prefix}_integral_q31", design.integral),
        "format": structs("pvid_weak_format_q31", f"{prefix}_format_q31", formats),
        "factor": structs("pvid_scaled_q31", f"{prefix}_factor_q31", design.factor),
        "noise": structs(
            "pvid_weak_noise_q31",
            f"{prefix}_noise_q31",
            [(x.kind, x.power, x.a, x.b, f"{{{x.factor[0]}, {x.factor[1]}}}") for x in design.noise],
        ),
        "error_order": numbers("uint8_t", f"{prefix}_error_order_q31", design.error_order),
        "error_variance": structs("pvid_scaled_q31", f"{prefix}_error_variance_q31", design.error_variance),
        "circle": numbers("PVID_TABLE int32_t", f"{prefix}_circle_q31", design.circle.tolist()),
    }
    sizes = ("functions", "power", "decimation", "sum_shift", "hop")
    struct = [
        f"static const pvid_weak_design_q31 {prefix}_design_q31 = {{",
        f"    .model = &{prefix}_weak_q31,",
        *(f"    .{name} = {getattr(design, name)}," for name in sizes),
        f"    .fine = {'true' if design.fine else 'false'},",
        f"    .n_noise = {len(design.noise)},",
        *(f"    .{name} = {prefix}_{name}_q31," for name, text in tables.items() if text),
        "};",
    ]
    return [*parts, *(text for text in tables.values() if text), "\n".join(struct)]


def configuration(config: WeakConfigQ31, prefix: str) -> str:
    """PREFIX_config_q31, behind the design."""
    parts = [numbers("int32_t", f"{prefix}_offset_q31", config.offset)]
    if config.drive_min is not None:
        parts.append(numbers("int32_t", f"{prefix}_drive_min_q31", config.drive_min))
    drive = f"{prefix}_drive_min_q31" if config.drive_min is not None else "NULL"
    if config.trust.shared is not None:
        parts.append(numbers("int32_t", f"{prefix}_shared_q31", config.trust.shared))
    shared = f"{prefix}_shared_q31" if config.trust.shared is not None else "NULL"
    struct = [
        f"static const pvid_weak_config_q31 {prefix}_config_q31 = {{",
        f"    .design = &{prefix}_design_q31,",
        f"    .offset = {prefix}_offset_q31,",
        f"    .drive_min = {drive},",
        f"    .compensation = {'true' if config.compensation else 'false'},",
        f"    .iterations = {config.iterations},",
        "    .estimator = {",
        *(f"        {one}," for one in fields_of(config.estimator)),
        "    },",
        f"    .trust = {{{', '.join(fields_of(config.trust, shared=shared))}}},",
        f"    .gate = {{{', '.join(fields_of(config.gate))}}},",
        "};",
    ]
    return "\n\n".join([*parts, "\n".join(struct)])


def fields_of(settings: EstimatorConfigQ31 | TrustConfigQ31 | GateConfigQ31, **given: str) -> list[str]:
    """ ".field = value" in C, in the order of the header; given: names of tables."""
    values = {one.name: getattr(settings, one.name) for one in fields(settings)} | given
    return [
        f".{name} = {{{', '.join(map(_literal, value))}}}" if isinstance(value, tuple) else f".{name} = {value}"
        for name, value in values.items()
    ]


def _literal(value: int) -> str:
    """Also of the least int32."""
    return "INT32_MIN" if value == -(2**31) else str(value)


def _functions(made: FixedWeak, prefix: str) -> str:
    """PREFIX_prepare_q31 and PREFIX_values_q31."""
    parts = []
    for name, one, limits in (
        ("prepare", made.prepare, made.prepare_limits),
        ("values", made.values, made.values_limits),
    ):
        if one is not None:
            signature = f"static bool {prefix}_{name}_q31(const int32_t in[], int32_t out[])"
            parts.append(fixed_function(signature, one, limits))
    return "\n\n".join(parts) + "\n"


_C = """\
static const int8_t {prefix}_p_bits[{n_p}] = {{{p_bits}}};
static const int16_t {prefix}_theta_bits[{n_theta}] = {{{theta_bits}}};
static const int16_t {prefix}_c_bits[{n_c}] = {{{c_bits}}};
static const uint8_t {prefix}_kind_end[{n_kinds}] = {{{kind_end}}};
static const uint8_t {prefix}_c_row[{n_c}] = {{{c_row}}};
static const uint8_t {prefix}_c_column[{n_c}] = {{{c_column}}};

/* x as an integer of this format, saturated at 2^60. */
static int64_t {prefix}_fixed(pvid_scaled_q31 x, int32_t bits)
{{
    const int32_t shift = -(x.e + bits);
    if (shift >= 0) {{
        return pvid_round_shift_q31(x.m, (uint32_t)shift);
    }}
    if (shift < -30) {{
        return (x.m > 0) ? ((int64_t)1 << 60) : ((x.m < 0) ? -((int64_t)1 << 60) : 0);
    }}
    return x.m * ((int64_t)1 << (uint32_t)-shift);
}}

static void {prefix}_numbers(const int32_t p[], pvid_scaled_q31 x[])
{{
    for (size_t i = 0; i < {n_p}u; i++) {{
        x[i] = pvid_scaled_of_q31(p[i], -(int32_t){prefix}_p_bits[i]);
    }}
}}

static void {prefix}_theta_fixed(const int32_t p[], int64_t theta[])
{{
    pvid_scaled_q31 x[{n_p}];
    pvid_scaled_q31 found[{n_theta}];
    {prefix}_numbers(p, x);
    {prefix}_theta_q31(x, found);
    for (size_t i = 0; i < {n_theta}u; i++) {{
        theta[i] = {prefix}_fixed(found[i], {prefix}_theta_bits[i]);
    }}
}}

static void {prefix}_jacobian_fixed(const int32_t p[], int64_t c[])
{{
    pvid_scaled_q31 x[{n_p}];
    pvid_scaled_q31 found[{n_c}];
    {prefix}_numbers(p, x);
    {prefix}_jacobian_q31(x, found);
    for (size_t i = 0; i < {n_c}u; i++) {{
        c[i] = {prefix}_fixed(found[i], {prefix}_c_bits[i]);
    }}
}}

/* Those of the configuration's p_bits, which must be {prefix}_p_bits. */
static void {prefix}_formats(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{{
    (void)p_bits;
    for (size_t i = 0; i < {n_theta}u; i++) {{
        theta_bits[i] = {prefix}_theta_bits[i];
    }}
    for (size_t i = 0; i < {n_c}u; i++) {{
        c_bits[i] = {prefix}_c_bits[i];
    }}
}}

static const pvid_model_q31 {prefix}_model_q31 = {{
    .n_theta = {n_theta},
    .n_p = {n_p},
    .n_kinds = {n_kinds},
    .n_c = {n_c},
    .positive = {positive}u,
    .kind_end = {prefix}_kind_end,
    .c_row = {prefix}_c_row,
    .c_column = {prefix}_c_column,
    .theta = {prefix}_theta_fixed,
    .jacobian = {prefix}_jacobian_fixed,
    .formats = {prefix}_formats,
}};
"""


def parameters_in_c(made: ParametersQ31, prefix: str) -> str:
    """PREFIX_model_q31 and its functions."""
    functions = made.functions
    generated = [
        scaled_function(f"static void {prefix}_{name}_q31(const pvid_scaled_q31 in[], pvid_scaled_q31 out[])", x)
        for name, x in (("theta", functions.theta.program), ("jacobian", functions.jacobian.program))
    ]

    def listed(values: Sequence[int]) -> str:
        return ", ".join(map(str, values))

    own = _C.format(
        prefix=prefix,
        n_p=len(made.p_bits),
        n_theta=len(made.theta_bits),
        n_c=len(made.c_bits),
        n_kinds=len(functions.kinds),
        kind_end=listed([one.theta.stop for one in functions.kinds]),
        p_bits=listed(made.p_bits),
        theta_bits=listed(made.theta_bits),
        c_bits=listed(made.c_bits),
        c_row=listed(functions.c_row),
        c_column=listed(functions.c_column),
        positive=sum(1 << k for k, one in enumerate(functions.model.unknowns) if one.positive),
    )
    return "\n\n".join([*generated, own])


def _about(weak: WeakQ31) -> list[str]:
    """The rig and the settings in words."""
    design, own = weak.config.design, weak.config.estimator
    compiled = weak.compiled
    units = {one.name: one.unit or "1" for one in compiled.signals}
    readings = [
        (f"reading[{k}]", name, f"{lsb:.6g} {units[name]} a count,", f"within +-{full} of its offset")
        for k, (name, lsb, full) in enumerate(zip(weak.sample_names, weak.lsb, design.full_scale, strict=True))
    ]
    parameters = [
        (
            f"{one.name} [{one.unit or '1'}]",
            f"= integer 2^{-bits},",
            f"start {weak.values(own.start)[k]:.6g},",
            f"{weak.values(own.lower)[k]:.6g} to {weak.values(own.upper)[k]:.6g}",
        )
        for k, (one, bits) in enumerate(zip(compiled.unknowns, own.p_bits, strict=True))
    ]
    first = f"at most {weak.ticks_needed} samples, {weak.ticks_needed / weak.sample_rate:.3g} s"
    return [
        f"{compiled.title}: {design.functions} test functions sin^{design.power} on windows of "
        f"{2 * weak.hop_s:.6g} s, one every {weak.hop_s:.6g} s;",
        f"{weak.sample_rate:.6g} samples a second, {design.decimation} make a step. The first estimate comes after "
        f"{first}.",
        "",
        "Readings [counts]:",
        *describe.table(readings),
        "",
        "Parameters:",
        *describe.table(parameters),
    ]
