"""The float32 files of a model's weak form for pvid/weak.h: header and source."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from pvid.codegen import c_f32, describe
from pvid.codegen.banner import banner, c_comment
from pvid.codegen.files_f32 import UNCONTRACTED, for_cpp, guarded, includes_of, model_struct
from pvid.codegen.functions import Function
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak import WeakFunctions
from pvid.codegen.weak_twin import functions_in
from pvid.core.sizes import raised, smallest
from pvid.design.c_tables import float_literal
from pvid.settings.weak import NONE, Source, WeakModel
from pvid.setup.weak_sizes import sizes_of_model

_SOURCES = {Source.SAMPLED: "", Source.HELD: "held until the next", Source.JUMP: "", Source.LAST: ""}


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


def header(made: WeakFunctions, model: WeakModel, needed: Mapping[str, int], command: str) -> str:
    """NAME_weak.h.

    Parameters
    ----------
    needed : sizes of the core that the model needs (pvid.setup.weak_sizes)
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
        includes_of(f"{name}_weak.h", functions_in(made), ("stddef.h",)),
        *(c_f32.function(_signature(one), one.program) for one in functions_in(made)),
        _form(model),
        model_struct(own, "theta", "jacobian").replace("\nconst ", "\nstatic const ", 1),
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
    return "\n".join(
        [
            _FORM,
            "{",
            *unused,
            *first,
            text,
            "}",
        ]
    )


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


def table(kind: str, name: str, size: str, entries: list[str]) -> str:
    """A constant array of structs."""
    lines = [f"    {one}," for one in entries]
    return "\n".join([f"static const {kind} {name}[{size}] = {{", *lines, "};"])


def _struct(model: WeakModel, name: str, upper: str) -> str:
    counts = ("samples", "signals", "jets", "runs", "signs", "gains", "integrands", "channels", "kinds")
    return "\n".join(
        [
            f"const pvid_weak_model_f32 {name}_weak_f32 = {{",
            *(f"    .{one} = {upper}_{one.upper()}," for one in counts),
            *(f"    .{one} = {one}," for one in ("signal", "jet", "channel", "term", "kind")),
            f"    .prepare = {'prepare' if model.prepare else 'NULL'},",
            "    .values = values,",
            "    .form = form,",
            f"    .model = &{name}_weak_model_f32,",
            "};",
        ]
    )
