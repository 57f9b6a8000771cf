"""The refinement's functions of a model in straight-line C: float32 for the core, float64 for this computer."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.codegen import describe
from pvid.codegen.c_functions import Language, c_literal, call_of, definition, statements
from pvid.codegen.c_text import c_comment, guarded, initialised, number
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import (
    RefineFunction,
    RefineFunctions,
    check_outputs,
    has_integrals,
    is_nonzero,
    refine_hash,
    refine_id,
    ring_of,
    signs_of,
    widths,
)
from pvid.model.operations import Literal, Program
from pvid.settings.refine import BIG_STEP, RefineConfig

WRITTEN = {  # by the core's functions, whatever the model has of it
    "constants": ("m",),
    "motion": ("a",),
    "jacobian": ("a", "K", "D", "B"),
    "output": ("z",),
    "output_jacobian": ("Zq", "Zv", "Zr"),
    "signs": ("g",),
    "chart": ("row",),
}
INLINE = "PVID_ALWAYS_INLINE void"
_WIDTH = 120
_NAMES = re.compile(r"[A-Za-z_]\w*")
_DEFINED = re.compile(r"^(?:const )?(?:float|double) (\w+)")
_MEANING = {
    "constants": "Once a pass: m from r.",
    "motion": "a: q'' of order 2, q' of order 1.",
    "jacobian": "a, da/dq, da/dv by rows; B[parameter][row] = da/d(steps of the motion's parameters).",
    "output": "z: what the sensors measure.",
    "output_jacobian": "dz/dq, dz/dv (only with PVID_REFINE_OUTPUT_RATES), dz/d(steps of r behind the moving ones).",
    "signs": "g: arguments of the signs.",
    "region": "Whether a mechanism with these parameters is possible.",
    "chart": "Derivatives by the steps of the motion's parameters to those by the steps of r.",
}


@dataclass(frozen=True)
class Real:
    """A type of numbers in C, and how operations on it are written."""

    name: str
    literal: Callable[[Fraction], str]
    calls: dict[str, str]
    turn: str


FLOAT = Real(
    "float",
    c_literal,
    {"abs": "pvid_magnitude_f32({})", "sqrt": "sqrtf({})", "neg": "-{}", "sign": "pvid_sign_f32({})"},
    "float sine_{angle}; float cosine_{angle}; pvid_sincos_f32({angle}, &sine_{angle}, &cosine_{angle});",
)
DOUBLE = Real(
    "double",
    lambda value: repr(float(value)),
    {
        "abs": "fabs({})",
        "sqrt": "sqrt({})",
        "neg": "-{}",
        "sign": "(double)(({0} > 0.0) - ({0} < 0.0))",
        "sin": "sin({})",
        "cos": "cos({})",
    },
    "",
)


def printed(model: GeneratedModel) -> dict[str, str]:
    """The files of the second stage, where there is one."""
    made = model.refinement.made
    return {} if made is None else files_of(made, model.command)


def printed_design(model: GeneratedModel) -> dict[str, str]:
    """NAME_refine_design_f32.h, where there is a rig and a second stage."""
    made, settings = model.refinement.made, model.options.refine_design
    if made is None or settings is None:
        return {}
    return {f"{made.name}_refine_design_f32.h": design_header(made, settings, model.command)}


def files_of(made: RefineFunctions, command: str) -> dict[str, str]:
    """pvid/refine_shape.h and refine_model_f32.h."""
    return {"pvid/refine_shape.h": shape(made, command), "refine_model_f32.h": header(made, command)}


def shape(made: RefineFunctions, command: str) -> str:
    """pvid/refine_shape.h: the numbers."""
    about = [
        f"pvid/refine_shape.h - numbers of the refinement's model: {made.model.title}.",
        "",
        *_banner(made, command),
        "",
        "Refined parameters r; the step of one marked log is a step of its logarithm:",
        *describe.table(
            [
                (f"r[{k}]", one.name, f"[{one.unit or '1'}]", "log" if one.log else "", _from(made, k))
                for k, one in enumerate(made.parameters)
            ]
        ),
        "Coordinates, inputs, outputs:",
        *describe.table(
            [
                *((f"q[{k}]", one) for k, one in enumerate(made.coordinates)),
                *((f"u[{k}]", _input(made, jet)) for k, jet in enumerate(made.inputs)),
                *((f"z[{k}]", one) for k, one in enumerate(made.outputs)),
            ]
        ),
    ]
    rates = any(is_nonzero(made, "Zv"))
    counts = [
        ("ORDER", made.order, "q'' = a(q, v, u, r)" if made.order == 2 else "q' = a(q, u, r)"),
        ("RUNGE_KUTTA", int(made.runge_kutta), "1: each step is Runge-Kutta's (ORDER 1), 0: Adams's"),
        ("COORDINATES", len(made.coordinates), "entries of q, hidden ones included"),
        ("HIDDEN", made.hidden, "coordinates that no sensor measures; counted with RUNGE_KUTTA"),
        ("OBSERVER", int(made.observer), "1: the noise of a measured input moves the model; with RUNGE_KUTTA"),
        ("INPUTS", len(made.inputs), "entries of u"),
        ("INTEGRALS", int(has_integrals(made)), "1: an input is the integral of a sample"),
        ("OUTPUTS", len(made.outputs), "entries of z, which are measured"),
        ("OUTPUT_RATES", int(rates), "1: an output depends on v"),
        ("OUTPUT_LINEAR", int(_is_linear(made)), "1: the derivatives of the outputs are constants"),
        ("TURNING", int(any(made.turning)), "1: an output is kept modulo an interval"),
        ("MOVING", made.moving - made.skew, "first entries of r: they change the motion"),
        ("SIGNS", len(signs_of(made.model)), "of friction in the equations"),
        ("WIDTHS", len(widths(made)), "first entries of r that are widths of signs"),
        ("SKEW", int(made.skew), "1: the entry behind them is the skew of the sensors"),
        ("PARAMETERS", len(made.parameters), "entries of r"),
        ("CONSTANTS", len(made.constants), "that the equations need of r"),
        ("P", len(made.places_of_p), "entries of the weak form's p that r needs"),
        ("MODEL_ID", refine_id(made), "changes with everything that the generated functions are made from"),
    ]
    wide = max(len(f"{name} {value}") for name, value, _ in counts)
    body = [f"#define PVID_REFINE_{f'{name} {value}'.ljust(wide)} /* {what} */" for name, value, what in counts]
    body += ["", *_ring(ring_of(made))]
    return _guarded("PVID_REFINE_SHAPE_H", about, body)


def _ring(entries: int) -> list[str]:
    return [
        "/* Entries of the ring of signals, a power of two: at least 1.5 blocks. RAM: 2 bytes for each signal. */",
        "#ifndef PVID_REFINE_RING",
        f"#define PVID_REFINE_RING {entries}",
        "#endif",
    ]


def header(made: RefineFunctions, command: str) -> str:
    """refine_model_f32.h: the functions."""
    check_outputs(made)
    kinds = {kind for one in made.functions.values() for kind in one.program.kinds}
    about = [
        f"{made.model.title}: equations of motion for the refinement (pvid/refine_shape.h) in float32.",
        "",
        *_banner(made, command),
        "",
        f"The motion's parameters: {', '.join(made.motion_names)}. Constants:",
        *describe.table([(f"m[{k}]", text) for k, text in enumerate(made.constants)]),
    ]
    body = [
        *(["#include <math.h>"] if "sqrt" in kinds else []),
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        *(['#include "number/sincos_f32.h"'] if kinds & {"sin", "cos"} else []),
        '#include "number/unroll.h"',
        *(['#include "pvid/elementary.h"'] if kinds & {"abs", "sign"} else []),
        '#include "pvid/refine_shape.h"',
        "",
        "/* Steps of an entry of r: 1: of its logarithm, 0: of itself. */",
        _table("logarithmic", "PARAMETERS", [int(one.log) for one in made.parameters]),
        "",
        f"#define PVID_REFINE_HAS_CHART {int('chart' in made.functions)}",
        "",
        *_measured(made),
        *(_turning(made) if any(made.turning) else []),
    ]
    for one in made.functions.values():
        body += [f"/* {_MEANING[one.name]} {one.program.cost.capitalize()}. */", function(one, FLOAT, made), ""]
    return _guarded("PVID_REFINE_MODEL_F32_H", about, [*body, *_places(made)])


def _turning(made: RefineFunctions) -> list[str]:
    values = ", ".join(str(int(one)) for one in made.turning)
    return [
        "/* 1: the motion is the same when this output is shifted, with the entries of the state that are near it. */",
        f"static const uint8_t pvid_refine_turning[PVID_REFINE_OUTPUTS] = {{{values}}};",
        "",
    ]


def _measured(made: RefineFunctions) -> list[str]:
    lines = [f"#define PVID_REFINE_HAS_MEASURED {int(any(made.measured))}", ""]
    if any(made.measured):
        about = "/* Entries of a state: 1 + 2 output: it is that output, 2 + 2 output: its rate, 0: neither. */"
        values = ", ".join(map(str, made.measured))
        lines = [about, f"static const uint8_t pvid_refine_measured[{len(made.measured)}] = {{{values}}};", *lines]
    return lines


def _guarded(guard: str, about: list[str], body: list[str]) -> str:
    return "\n".join([c_comment(about), f"#ifndef {guard}", f"#define {guard}", "", *body, "", "#endif", ""])


def _banner(made: RefineFunctions, command: str) -> list[str]:
    return [f"Generated by `{command}`: do not edit.", f"Input {refine_hash(made)}."]


def _is_linear(made: RefineFunctions) -> bool:
    """Whether the derivatives of the outputs are constants."""
    program = made.functions["output_jacobian"].program
    return all(isinstance(program.values[place], Literal) for place in program.results)


def _from(made: RefineFunctions, entry: int) -> str:
    one = made.parameters[entry]
    if one.place >= 0:
        return f"p[{one.place}] of the weak form"
    if one.sign:
        return f"width of the sign of {one.sign}"
    skewed = made.skew and entry == made.moving - 1
    return "by which the sensors are late on the inputs" if skewed else "starts at 0"


def _input(made: RefineFunctions, jet: sp.Symbol) -> str:
    for one, value in made.model.opaque.items():
        if one == jet:
            return f"{jet} = {value}"
    return str(jet)


def _table(name: str, size: str, values: Sequence[int]) -> str:
    return f"static const uint8_t pvid_refine_{name}[PVID_REFINE_{size}] = {{{', '.join(map(str, values))}}};"


def _places(made: RefineFunctions) -> list[str]:
    """Between p of the weak form and r."""
    to_r = [f"r[{k}] = {f'p[{one.place}]' if one.place >= 0 else '0.0f'};" for k, one in enumerate(made.parameters)]
    return [
        "/* r of an estimate of the weak form; entries that it does not have are 0, widths as well. */",
        definition("static inline void pvid_refine_from_p(const float p[], float r[])", to_r),
        "",
        "/* Entries of p by that of r, for the comparison of the two estimates. */",
        _table("place_of_p", "P", made.places_of_p),
    ]


def function(one: RefineFunction, real: Real, made: RefineFunctions | None = None) -> str:
    """A definition of a function, inline; with `made` as the core's kernel takes it: see `header`."""
    lines, results = body(one.program, [f"{key}[{k}]" for key, n in one.given for k in range(n)], real)
    given = [key for key, _ in one.given]
    if one.name == "region":
        signature = f"static inline bool pvid_refine_region(const {real.name} r[])"
        zero = real.literal(Fraction(0))
        return definition(signature, [*lines, f"return {' && '.join(f'({text} > {zero})' for text in results)};"])
    names = list(given)
    if made is not None and one.name.startswith("output"):
        names.insert(1, "r")
    written = [key for key, _ in one.written] if made is None else list(WRITTEN[one.name])
    arguments = [f"const {real.name} {key}[]" for key in names if key not in written]
    arguments += [f"{real.name} {key}[]" for key in written]
    places = [f"{key}[{k}]" for key, n in one.written for k in range(n)]
    stored = [f"{place} = {text};" for place, text in zip(places, results, strict=True) if place != text]
    if made is not None:
        stored = [one for one in stored if one.partition("[")[0] in written]
    if made is not None and one.name == "output_jacobian":
        stored = _tail(made, stored)
    kept = _needed(lines, stored)
    used = "\n".join([*kept, *stored])
    unread = [f"(void){key};" for key in [*names, *written] if not re.search(rf"\b{key}\[", used)]
    start = "static inline void" if real.name == "double" or one.name != "motion" and one.name != "jacobian" else INLINE
    return definition(_wrapped(f"{start} pvid_refine_{one.name}(", arguments), [*kept, *stored, *unread])


def _tail(made: RefineFunctions, stored: list[str]) -> list[str]:
    """Without derivatives by the motion's parameters, and by rates where there are none."""
    width, moving = len(made.parameters) - made.skew, made.moving - made.skew
    found = []
    for line in stored:
        key, _, value = line.partition("[")
        if key == "Zv" and not any(is_nonzero(made, "Zv")):
            continue
        if key == "Zr":
            row, column = divmod(int(value.partition("]")[0]), width)
            if column < moving:
                continue
            line = f"Zr[{row * (width - moving) + column - moving}]{line.partition(']')[2]}"
        found.append(line)
    return found


def _needed(lines: list[str], stored: list[str]) -> list[str]:
    """Statements whose values are read."""
    kept: list[str] = []
    read = set(_NAMES.findall("\n".join(stored)))
    for line in reversed(lines):
        name = _DEFINED.search(line)
        if name is None or name.group(1) in read or "&" in line:
            kept.append(line)
            read |= set(_NAMES.findall(line))
    return kept[::-1]


def _wrapped(start: str, arguments: list[str]) -> str:
    """A signature in lines of at most 120 characters, as clang-format has it."""
    lines, line = [], start
    for k, one in enumerate(arguments):
        text = one + (")" if k == len(arguments) - 1 else ",")
        if len(line) + len(text) + (line[-1] != "(") > _WIDTH:
            lines.append(line)
            line = " " * len(start) + text
        else:
            line += text if line[-1] == "(" else f" {text}"
    return "\n".join([*lines, line])


def body(program: Program, arguments: list[str], real: Real) -> tuple[list[str], list[str]]:
    """Statements and the texts of the results; sine and cosine of one angle come together."""
    turns: set[str] = set()

    def operation(place: int, operands: list[str]) -> str:
        kind = program.kind(place)
        if real.turn and kind in ("sin", "cos"):
            text = f"{'sine' if kind == 'sin' else 'cosine'}_{operands[0]}"
            if operands[0] in turns:
                return text
            turns.add(operands[0])
            return f"{text}|{real.turn.format(angle=operands[0])}"
        return call_of(program, place, operands, real.calls)

    def statement(name: str, text: str) -> str:
        text, _, ahead = text.partition("|")
        before = [f"{one};" for one in ahead.rstrip(";").split("; ")] if ahead else []
        return "\n".join([*before, f"const {real.name} {name} = {text};"])

    language = Language(statement, lambda k: arguments[k], lambda k: real.literal(program.literal(k)), operation)
    lines, results = statements(program, language)
    return [one for line in lines for one in line.split("\n")], results


def _row(values: npt.ArrayLike | Sequence[float]) -> str:
    return "{" + ", ".join(number(float(one)) for one in np.asarray(values)) + "}"


# Fields that not every build has, and how they are written.
_OPTIONAL: Mapping[str, Callable[[Any], str]] = {
    "parts": str,
    "fine_parts": str,
    "step_fine": number,
    "observer": _row,
    "width": _row,
}


def design_header(made: RefineFunctions, settings: RefineConfig, command: str) -> str:
    """The file."""
    name, step_s = made.name, settings.ratio / settings.sample_rate
    config = f"{name}_refine_config_f32"
    about = [
        f"{name}_refine_design_f32.h - {made.model.title}: settings of the refinement for a rig, float32.",
        "",
        f"Generated by `{command}`: do not edit.",
        "",
        "The second stage of the weak form (pvid/refine.h):",
        "",
        "  static pvid_refine_f32 refinement;",
        f"  static const pvid_weak_refine_f32 second = {{&pvid_refiner_f32, &refinement, &{config}}};",
        f"  pvid_weak_config_f32 config = {name}_config_f32;",
        "  config.refine = &second;",
        "  if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...",
        "",
        f"{settings.sample_rate:.6g} samples a second, {settings.ratio} in a step of the motion; blocks of "
        f"{settings.block * BIG_STEP * step_s:.3g} s.",
    ]
    body = [
        '#include "pvid/refine.h"',
        "",
        f"#if PVID_REFINE_MODEL_ID != {refine_id(made)}",
        f'#error "{name}: compile pvid with the refine_model_f32.h of this folder, -DPVID_REFINE_MODEL="',
        "#endif",
        "",
        *design_tables(settings, config),
    ]
    return guarded(f"{name}_refine_design_f32", about, body)


def design_tables(settings: RefineConfig, name: str) -> list[str]:
    """The configuration in C: static const `name`, behind its tables."""
    signals = [
        f"    {{{one.sample}u, {one.order}, {int(one.source)}u, {number(one.scale)}, {number(one.range)}}},"
        for one in settings.signal
    ]
    second = [] if settings.second is None else [f"static const float {name}_second[] = {_row(settings.second)};"]
    fields = {
        "sample_rate_hz": number(settings.sample_rate),
        "ratio": settings.ratio,
        "second": f"{name}_second" if second else "NULL",
        "signal": f"{name}_signal",
        **{one: getattr(settings, one) for one in ("block", "first_block", "passes", "most_passes", "jobs", "rests")},
        **{one: _row(getattr(settings, one)) for one in ("sd", "prior_sd", "state_limit")},
        **{
            one: number(getattr(settings, one))
            for one in (
                *("forgetting_s", "outlier_gate", "gate", "chi_max", "clash_max", "step_max", "step_limit"),
                *("se_max", "distance"),
            )
        },
    }
    for one, written in _OPTIONAL.items():
        value = getattr(settings, one)
        fields |= {} if value is None else {one: written(value)}
    return [
        *second,
        f"static const pvid_refine_signal_f32 {name}_signal[] = {{",
        *signals,
        "};",
        "",
        initialised(f"static const pvid_refine_config_f32 {name}", fields),
    ]
