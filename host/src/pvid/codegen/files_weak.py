"""The float32 files of a model's weak form for pvid/weak.h: the model, and tables and settings for a rig."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from pvid.codegen import describe
from pvid.codegen.c_functions import float_function
from pvid.codegen.c_text import (
    UNCONTRACTED,
    array,
    banner,
    c_comment,
    for_cpp,
    guarded,
    initialised,
    inner,
    number,
    table,
)
from pvid.codegen.files_functions import includes_of, model_struct
from pvid.codegen.fitted_sizes import config_header, fitted_sizes
from pvid.codegen.functions import Function
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak import WeakFunctions
from pvid.codegen.weak_sizes import sizes_of_design, sizes_of_model
from pvid.core.sizes import raised, smallest
from pvid.design.c_tables import float_literal
from pvid.model.compiled import CompiledModel
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfig, GateConfig, TrustConfig
from pvid.settings.weak import NONE, Float32, Source, WeakConfig, WeakDesign32, WeakModel


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_weak.h and NAME_weak_f32.c, where there is a weak form."""
    made = model.weak.made
    if made is None:
        return {}
    tables = model.weak_model
    return {
        f"{made.name}_weak.h": header(made, tables, sizes_of_model(tables), model.command),
        f"{made.name}_weak_f32.c": source(made, tables, model.command),
    }


def printed_design(model: GeneratedModel) -> dict[str, str]:
    """NAME_design_f32.h and NAME_config.h, where there is a rig and a weak form."""
    options, compiled, name = model.options, model.compiled, model.name
    if options.design is None or model.weak.made is None:
        return {}
    design = replace(options.design, design=options.design.design.with_soft_widths(options.soft_signs))
    return {
        f"{name}_design_f32.h": design_header(design, compiled, model.command, design.causes),
        f"{name}_config.h": config_header(f"{name}_config", fitted_sizes(design), model.command),
    }


def header(made: WeakFunctions, model: WeakModel, needed: Mapping[str, int], command: str) -> str:
    """NAME_weak.h.

    Parameters
    ----------
    needed : sizes of the core that the model needs (pvid.codegen.weak_sizes)
    """
    name, upper = made.name, made.name.upper()
    about = [
        f"{name}_weak.h - {made.model.title}: the weak form for pvid/weak.h, float32.",
        "",
        *banner(made.functions, command),
        "",
        f'  #include "{name}_design_f32.h"          or a design of your own',
        "  static pvid_weak_f32 identifier;",
        f"  if (pvid_weak_init_f32(&identifier, &{name}_config_f32) != PVID_OK) ...",
        "  each tick: reason = pvid_weak_step_f32(&identifier, sample);",
        "",
        "Samples of a tick:",
        *describe.table(_samples(made)),
        "",
        *describe.everything(made.functions),
    ]
    counts = {
        "P": model.model.n_p,
        "THETA": model.model.n_theta,
        "C": len(made.functions.c_row),
        "KINDS": model.kinds,
        "SAMPLES": model.samples,
        "SIGNALS": model.signals,
        "JETS": model.jets,
        "RUNS": model.runs,
        "SIGNS": model.signs,
        "GAINS": model.gains,
        "INTEGRANDS": model.integrands,
        "CHANNELS": model.channels,
        "TERMS": len(model.term),
    }
    body = [
        '#include "pvid/weak.h"',
        "",
        *size_check(needed),
        "",
        *(f"#define {upper}_WEAK_{what} {count}" for what, count in counts.items()),
        "",
        *for_cpp(
            [
                "/* Tables of channels and terms, and the functions of the equations. */",
                f"extern const pvid_weak_model_f32 {name}_weak_f32;",
                "",
            ]
        ),
    ]
    return guarded(f"{name}_weak", about, body)


def size_check(needed: Mapping[str, int]) -> list[str]:
    """An error for a library of smaller arrays."""
    options = " ".join(f"-D{macro}={size}" for macro, size in smallest(raised(needed) or needed).items())
    checks = " || \\\n    ".join(" || ".join(one) for one in _pairs([f"{k} < {v}" for k, v in needed.items()]))
    return [f"#if {checks}", f'#error "compile pvid and this file with {options}"', "#endif"]


def _pairs(checks: list[str]) -> list[list[str]]:
    return [checks[k : k + 3] for k in range(0, len(checks), 3)]


def _samples(made: WeakFunctions) -> list[tuple[str, ...]]:
    signals = {one.name: one for one in made.model.signals}
    held = {one.sample for one in made.signal if one.source is Source.HELD}
    return [
        (f"sample[{k}]", name, f"[{signals[name].unit or '1'}]", "held until the next" if k in held else "")
        for k, name in enumerate(made.samples)
    ]


def source(made: WeakFunctions, model: WeakModel, command: str) -> str:
    """NAME_weak_f32.c."""
    name, upper = made.name, f"{made.name.upper()}_WEAK"
    own = replace(made.functions, name=f"{name}_weak")
    parts = [
        c_comment(banner(made.functions, command)),
        UNCONTRACTED,
        includes_of(f"{name}_weak.h", made.with_results, ("stddef.h",)),
        *(float_function(_signature(one), one.program) for one in made.with_results),
        _form(model),
        model_struct(own, {one.name: one.name for one in made.with_results}).replace("\nconst ", "\nstatic const ", 1),
        *_tables(model, upper),
        _struct(model, name, upper),
    ]
    return "\n\n".join(parts) + "\n"


_FORM = "static void form(const float *restrict gain, const float *restrict integral, float t, float *restrict channel)"


def _form(model: WeakModel) -> str:
    """The function that makes the channels of a step."""
    square = "half_square"
    lines = []
    for place, one in enumerate(model.channel):
        if one.gain == NONE:
            continue
        factors = [f"gain[{one.gain}]"]
        if one.fold and one.integrand == NONE:
            factors.append("t" if one.fold == 1 else square)
        elif one.fold:
            factors.append(f"integral[{2 * one.integrand + one.fold - 1}]")
        lines.append(f"    channel[{place}] = {' * '.join(factors)};")
    text = "\n".join(lines)
    first = [f"    const float {square} = 0.5f * (t * t);"] if square in text else []
    unused = [
        f"    (void){name};" for name in ("integral", "t") if not re.search(rf"\b{name}\b", "\n".join([*first, text]))
    ]
    return "\n".join([_FORM, "{", *unused, *first, text, "}"])


def _signature(function: Function) -> str:
    return f"static void {function.name}(const float in[], float out[])"


def _tables(model: WeakModel, upper: str) -> list[str]:
    signals = [f"{{{one.sample}, PVID_SIGNAL_{one.source.name}}}" for one in model.signal]
    jets = [f"{{{one.signal}, {one.order}}}" for one in model.jet]
    channels = [
        f"{{{_place(one.gain)}, {_place(one.integrand)}, {one.fold}, {_place(one.plain)}, {_place(one.ramp)}}}"
        for one in model.channel
    ]
    terms = [f"{{{one.channel}, {one.order}, {one.column}, {float_literal(one.factor)}}}" for one in model.term]
    kinds = [f"{{{one.thetas}, {one.nuisances}, {one.first}, {one.end}}}" for one in model.kind]
    return [
        table("pvid_weak_signal", "signal", f"{upper}_SIGNALS", signals),
        table("pvid_weak_jet", "jet", f"{upper}_JETS", jets),
        table("pvid_weak_channel", "channel", f"{upper}_CHANNELS", channels),
        table("pvid_weak_term_f32", "term", f"{upper}_TERMS", terms),
        table("pvid_weak_kind", "kind", f"{upper}_KINDS", kinds),
    ]


def _place(place: int) -> str:
    return "PVID_WEAK_NONE" if place == NONE else str(place)


def _struct(model: WeakModel, name: str, upper: str) -> str:
    counts = ("samples", "signals", "jets", "runs", "signs", "gains", "integrands", "channels", "kinds")
    return "\n".join(
        [
            f"const pvid_weak_model_f32 {name}_weak_f32 = {{",
            *(f"    .{one} = {upper}_{one.upper()}," for one in counts),
            *(f"    .{one} = {one}," for one in ("signal", "jet", "channel", "term", "kind")),
            f"    .prepare = {'prepare' if model.runs + model.signs else 'NULL'},",
            "    .values = values,",
            "    .form = form,",
            f"    .model = &{name}_weak_model_f32,",
            "};",
        ]
    )


_WIDTH = 8  # numbers a line


def design_header(config: WeakConfig, compiled: CompiledModel, command: str, causes: Sequence[str] = ()) -> str:
    """NAME_design_f32.h.

    Parameters
    ----------
    config : settings and tables for the rig
    command : that makes it; no date, so that the same command makes the same file
    causes : of the shared errors, for its banner; the text of a log does not have them
    """
    design = config.design
    name = design.model.name
    own = config.estimator
    window_s, step_s = 2 * config.hop_s, config.dt
    about = [
        f"{name}_design_f32.h - {compiled.title}: tables and settings of the weak form for a rig, float32.",
        "",
        f"Generated by `{command}`: do not edit.",
        "",
        f"{design.functions} test functions sin^{design.power} on windows of {window_s:.6g} s, one every "
        f"{config.hop_s:.6g} s; {config.sample_rate:.6g} samples a second, one of {design.decimation} is a step "
        f"of {step_s:.6g} s.",
        f"The first estimate comes after at most {config.ticks_needed} samples, "
        f"{config.ticks_needed / config.sample_rate:.3g} s.",
        "",
        f"Sizes of the core for it alone, for the least RAM and the fewest instructions ({name}_config.h has them):",
        f"  {' '.join(f'-D{macro}={size}' for macro, size in fitted_sizes(config).items())}",
        "",
        "Parameters:",
        *describe.table(
            [
                (f"{one.name} [{one.unit or '1'}]", f"start {start:.6g},", f"{low:.6g} to {high:.6g}")
                for one, start, low, high in zip(compiled.unknowns, own.start, own.lower, own.upper, strict=True)
            ]
        ),
        *shared_errors(causes),
    ]
    body = [
        "#include <stddef.h>",
        "",
        f'#include "{name}_weak.h"',
        "",
        *size_check(sizes_of_design(design)),
        "",
        *_design_tables(design),
        "",
        _design_struct(design),
        "",
        *_checks(config),
        _config(config),
    ]
    return guarded(f"{name}_design_f32", about, body)


def shared_errors(causes: Sequence[str]) -> list[str]:
    """Lines on them, for a banner."""
    return (
        ["", "Of each published standard error, shared by all windows (trust.h):", *(f"  {one}" for one in causes)]
        if causes
        else []
    )


def floats(name: str, values: Float32, comment: str) -> str:
    return f"/* {comment} */\n{array('float', name, map(float_literal, values), _WIDTH)}"


def _design_tables(design: WeakDesign32) -> list[str]:
    name = design.model.name
    upper = f"{name.upper()}_WEAK"
    arrays: dict[bytes, str] = {}
    parts: list[str] = []
    filters: list[str] = []
    for one, jet in zip(design.compensator, design.model.jet, strict=True):
        if not one.half:
            filters.append("{0, NULL}")
            continue
        key = one.weights.tobytes()
        if key not in arrays:
            arrays[key] = f"{name}_filter_{len(arrays)}"
            parts.append(floats(arrays[key], one.weights, f"derivative {jet.order}, from the centre outwards"))
        filters.append(f"{{{one.half}, {arrays[key]}}}")
    noise = [f"{{{x.kind}, {x.power}, {x.a}, {x.b}, {float_literal(x.factor)}}}" for x in design.noise]
    parts += [
        table("pvid_weak_filter_f32", f"{name}_filter", f"{upper}_JETS", filters),
        floats(f"{name}_circle", design.circle, "sin(pi j / hop)"),
    ]
    if noise:
        parts.append(table("pvid_weak_noise_f32", f"{name}_noise", str(len(noise)), noise))
    orders = ", ".join(map(str, design.error_order.tolist()))
    parts += [
        f"static const uint8_t {name}_error_order[{upper}_KINDS] = {{{orders}}};",
        floats(f"{name}_error_variance", design.error_variance, "of the equations' own errors"),
    ]
    if design.model.signs:
        parts.append(floats(f"{name}_sign_width", design.sign_width, "0: the mean of the sign over a step"))
    if design.sign_doubt is not None:
        parts.append(floats(f"{name}_sign_doubt", design.sign_doubt, "of slower motion the sign is in doubt"))
    return ["\n\n".join(parts)]


def _design_struct(design: WeakDesign32) -> str:
    name = design.model.name
    fields = {
        "model": f"&{name}_weak_f32",
        "functions": design.functions,
        "power": design.power,
        "decimation": design.decimation,
        "hop": design.hop,
        "compensator": f"{name}_filter",
        "circle": f"{name}_circle",
        "noise": f"{name}_noise" if design.noise else "NULL",
        "n_noise": len(design.noise),
        "error_order": f"{name}_error_order",
        "error_variance": f"{name}_error_variance",
        "sign_width": f"{name}_sign_width" if design.model.signs else "NULL",
        "sign_doubt": "NULL" if design.sign_doubt is None else f"{name}_sign_doubt",
        "overlap": float_literal(np.float32(design.overlap)),
    }
    return initialised(f"static const pvid_weak_design_f32 {name}_design_f32", fields)


def _checks(config: WeakConfig) -> list[str]:
    name = config.design.model.name
    given = {
        "range": (config.range, "of each sample"),
        "drive_min": (config.drive_min, "of each sample"),
        "shared": (config.trust.shared, "errors that all windows share: trust.h"),
    }
    return [
        one
        for field, (values, comment) in given.items()
        if values is not None
        for one in (floats(f"{name}_{field}", values, comment), "")
    ]


def _config(config: WeakConfig) -> str:
    name = config.design.model.name
    values = {
        "sample_rate_hz": number(config.sample_rate),
        "design": f"&{name}_design_f32",
        "range": "NULL" if config.range is None else f"{name}_range",
        "drive_min": "NULL" if config.drive_min is None else f"{name}_drive_min",
        "compensation": str(config.compensation).lower(),
        "iterations": config.iterations,
        "estimator": inner(fields_in_c(config.estimator)),
        "trust": inner(
            fields_in_c(config.trust) | {"shared": "NULL" if config.trust.shared is None else f"{name}_shared"}
        ),
        "gate": inner(fields_in_c(config.gate)),
    }
    return initialised(f"static const pvid_weak_config_f32 {name}_config_f32", values)


def fields_in_c(settings: EstimatorConfig | TrustConfig | GateConfig) -> dict[str, object]:
    """Field -> value in C, in the order of the header."""
    out: dict[str, object] = {}
    for field in fields(settings):
        value = getattr(settings, field.name)
        if isinstance(value, np.ndarray):
            out[field.name] = "{" + ", ".join(map(float_literal, value)) + "}"
        elif isinstance(value, Law):
            out[field.name] = f"PVID_LAW_{value.name}"
        else:
            out[field.name] = number(value) if field.type == "float" else value
    return out
