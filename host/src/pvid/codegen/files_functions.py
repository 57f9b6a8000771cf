"""The functions of a model in C: float32, and integers without any floating point. Headers and sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pvid.codegen import describe
from pvid.codegen.c_functions import fixed_function, float_function, scaled_function
from pvid.codegen.c_text import UNCONTRACTED, banner, c_comment, for_cpp, guarded, number
from pvid.codegen.fixed_model import FixedModel
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.generated import GeneratedModel

# Sizes of what each function is given and writes, as in NAME_P.
SIZES = {
    "integrands": ("INPUTS", "INTEGRANDS"),
    "channels": ("INPUTS", "CHANNELS"),
    "theta": ("P", "THETA"),
    "jacobian": ("P", "C"),
    "constraints": ("P", "CONSTRAINED"),
    "drifts": ("P", "DRIFTING"),
}


MEANING = {
    "integrands": "From the inputs: what is integrated for the inputs that are integrals.",
    "channels": "From the inputs of one instant: the channels.",
    "theta": "From p: theta.",
    "jacobian": "From p: the non-zeros of d theta / d p by columns, in the order of c_row and c_column.",
    "drifts": "From p: the directions in which it drifts.",
    "constraints": "From p: each constraint, which is 0, and its derivatives by p.",
}


def printed_f32(model: GeneratedModel) -> dict[str, str]:
    """NAME_sizes.h, NAME.h and NAME_f32.c."""
    functions, name = model.functions, model.name
    return {
        f"{name}_sizes.h": _sizes(functions, model.command),
        f"{name}.h": _header(functions, model.command),
        f"{name}_f32.c": _source(functions, model.command),
    }


def _sizes(functions: ModelFunctions, command: str) -> str:
    """NAME_sizes.h."""
    name, upper = functions.name, functions.name.upper()
    counts = {
        "P": len(functions.model.unknowns),
        "THETA": len(functions.theta.labels),
        "C": len(functions.c_row),
        "KINDS": len(functions.kinds),
        "INPUTS": len(functions.inputs),
        "CHANNELS": len(functions.channels.labels),
    }
    if functions.integrands.labels:
        counts["INTEGRANDS"] = len(functions.integrands.labels)
    if functions.constraints.labels:
        counts["CONSTRAINED"] = len(functions.constraints.labels)
    if functions.drifts.labels:
        counts["DRIFTING"] = len(functions.drifts.labels)
    about = [
        f"{name}_sizes.h - how many parameters, coefficients and channels {name} has.",
        "",
        *banner(functions, command),
    ]
    defined = [f"#define {upper}_{what} {count}" for what, count in counts.items()]
    return guarded(f"{name}_sizes", about, defined)


def _header(functions: ModelFunctions, command: str) -> str:
    """NAME.h."""
    name = functions.name
    about = [
        f"{name}.h - {functions.model.title}: the functions of its rows sum theta_j(p) N_j = Y in float32.",
        "",
        *banner(functions, command),
        "",
        *describe.everything(functions),
    ]
    declared = [
        *_prototypes(functions),
        "/* theta and C of all rows for the estimator, which is given each row with its kind:",
        " * pvid_estimator_add_kind_f32. */",
        f"extern const pvid_model_f32 {name}_model_f32;",
        "",
    ]
    return guarded(name, about, [f'#include "{name}_sizes.h"', '#include "pvid/model.h"', "", *for_cpp(declared)])


def _prototypes(functions: ModelFunctions) -> list[str]:
    lines: list[str] = []
    for function in functions.functions:
        lines += [f"/* {MEANING[function.name]} {function.program.cost}. */", f"{_signature(functions, function)};", ""]
    return lines


def _signature(functions: ModelFunctions, function: Function) -> str:
    """As in the header."""
    upper = functions.name.upper()
    given, written = SIZES[function.name]
    return f"void {functions.name}_{function.name}_f32(const float in[{upper}_{given}], float out[{upper}_{written}])"


def _source(functions: ModelFunctions, command: str) -> str:
    """NAME_f32.c."""
    name = functions.name
    parts = [
        c_comment(banner(functions, command)),
        UNCONTRACTED,
        includes_of(f"{name}.h", functions.functions),
        *(float_function(_signature(functions, one), one.program) for one in functions.functions),
        model_struct(functions, {one.name: f"{name}_{one.name}_f32" for one in functions.functions}),
    ]
    return "\n\n".join(parts) + "\n"


def includes_of(header: str, functions: Sequence[Function], standard: Sequence[str] = ()) -> str:
    """What a source with these functions includes."""
    kinds = {kind for function in functions for kind in function.program.kinds}
    groups = [[f'#include "{header}"']]
    if kinds & {"sin", "cos", "sign", "soft_sign", "abs"}:
        groups.append(['#include "pvid/elementary.h"'])
    names = sorted({*standard, *(["math.h"] if "sqrt" in kinds else [])})
    if names:
        groups.append([f"#include <{one}>" for one in names])
    return "\n\n".join("\n".join(group) for group in groups)


def model_struct(functions: ModelFunctions, named: Mapping[str, str]) -> str:
    """The pattern and NAME_model_f32, with these functions by name."""
    model = functions.model
    anchors = ", ".join(number(model.anchors.get(one, 0.0)) for one in model.p)
    tied = [f"    .n_constraints = {len(model.constraints)},", f"    .constraints = {named.get('constraints')},"]
    moving = [
        f"    .n_drifts = {len(model.drifts)},",
        f"    .drift_s = {number(model.drift_s)},",
        "    .anchor_sd = anchor_sd,",
        f"    .drifts = {named.get('drifts')},",
    ]
    name, upper = functions.name, functions.name.upper()
    positive = sum(1 << k for k, one in enumerate(functions.model.unknowns) if one.positive)
    several = len(functions.kinds) > 1
    ends = ", ".join(map(str, functions.kind_end))
    return "\n".join(
        [
            *([f"static const float anchor_sd[{upper}_P] = {{{anchors}}};"] if model.drifts else []),
            *([f"static const uint8_t kind_end[{upper}_KINDS] = {{{ends}}};"] if several else []),
            f"static const uint8_t c_row[{upper}_C] = {{{', '.join(map(str, functions.c_row))}}};",
            f"static const uint8_t c_column[{upper}_C] = {{{', '.join(map(str, functions.c_column))}}};",
            "",
            f"const pvid_model_f32 {name}_model_f32 = {{",
            f"    .n_theta = {upper}_THETA,",
            f"    .n_p = {upper}_P,",
            *([f"    .n_kinds = {upper}_KINDS,"] if several else []),
            f"    .n_moments = {functions.moments},",
            f"    .n_c = {upper}_C,",
            f"    .positive = {positive}u,",
            *(["    .kind_end = kind_end,"] if several else []),
            "    .c_row = c_row,",
            "    .c_column = c_column,",
            f"    .theta = {named['theta']},",
            f"    .jacobian = {named['jacobian']},",
            *(tied if model.constraints else []),
            *(moving if model.drifts else []),
            "};",
        ]
    )


def printed_q31(model: GeneratedModel) -> dict[str, str]:
    """NAME_q31.h and NAME_q31.c, where fixed point can compute all functions."""
    fixed, name = model.fixed.made, model.name
    if fixed is None:
        return {}
    return {f"{name}_q31.h": _header_q31(fixed, model.command), f"{name}_q31.c": _source_q31(fixed, model.command)}


def _header_q31(fixed: FixedModel, command: str) -> str:
    """NAME_q31.h."""
    functions = fixed.functions
    name, upper = functions.name, functions.name.upper()
    about = [
        f"{name}_q31.h - {functions.model.title}: functions of its rows sum theta_j(p) N_j = Y in integers.",
        "",
        *banner(functions, command),
        "",
        "Inputs and channels are int32, a value is its integer times 2^-bits. p, theta and C are numbers",
        "of any size with 30 digits: pvid/scaled_q31.h.",
        "",
        *_formats(fixed),
        "",
        *describe.everything(functions),
    ]
    lines: list[str] = []
    for one in fixed.of_inputs:
        what = one.function
        lines += [
            f"/* {MEANING[what.name]} {what.program.cost}. Returns false, and",
            " * writes nothing, iff an input is beyond its reach. */",
            f"{_signature_q31(functions, what)};",
            "",
        ]
    for what in fixed.of_parameters:
        lines += [f"/* {MEANING[what.name]} {what.program.cost}. */", f"{_signature_q31(functions, what)};", ""]
    lines += [
        "/* Formats [bits] of inputs and results. */",
        f"extern const int8_t {name}_in_bits_q31[{upper}_INPUTS];",
        *(
            f"extern const int8_t {name}_{one.function.name}_bits_q31[{upper}_{SIZES[one.function.name][1]}];"
            for one in fixed.of_inputs
        ),
        "",
        "/* Row and column of each non-zero of C. */",
        f"extern const uint8_t {name}_c_row_q31[{upper}_C];",
        f"extern const uint8_t {name}_c_column_q31[{upper}_C];",
        "",
        "/* theta and C of all rows for the estimator, which is given each row with its kind:",
        " * pvid_estimator_add_kind_q31. init refuses it unless the library is compiled with",
        f" * {', '.join(f'{macro} >= {size}' for macro, size in sizes_of(functions).items())}. */",
        f"extern const pvid_model_q31 {name}_model_q31;",
        "",
    ]
    includes = [f'#include "{name}_sizes.h"', '#include "pvid/elementary_q31.h"', '#include "pvid/model_q31.h"']
    body = [*includes, "", *for_cpp(lines)]
    return guarded(f"{name}_q31", about, body)


def sizes_of(functions: ModelFunctions) -> dict[str, int]:
    """What pvid_model_q31 needs of pvid/config.h."""
    return {
        "PVID_MAX_P": len(functions.model.unknowns),
        "PVID_MAX_THETA_Q31": len(functions.theta.labels),
        "PVID_MAX_MOMENTS_Q31": functions.moments,
        "PVID_MAX_C_Q31": len(functions.c_row),
    }


def _formats(fixed: FixedModel) -> list[str]:
    functions = fixed.functions
    lines = ["Formats:"]
    table = [
        (f"in[{k}]", one.meaning, f"{bits} bits", f"|in[{k}]| <= {reach:.6g} {one.unit}".rstrip())
        for k, (one, bits, reach) in enumerate(zip(functions.inputs, fixed.input_bits, fixed.reaches, strict=True))
    ]
    lines += describe.table(table)
    for one in fixed.of_inputs:
        bits = zip(one.function.labels, one.made.result_bits, strict=True)
        word = one.function.name.removesuffix("s")
        lines += describe.table([(f"{word}[{k}]", label, f"{places} bits") for k, (label, places) in enumerate(bits)])
    return lines


def _signature_q31(functions: ModelFunctions, function: Function) -> str:
    """As in the header."""
    upper = functions.name.upper()
    given, written = SIZES[function.name]
    result, number = ("void", "pvid_scaled_q31") if given == "P" else ("bool", "int32_t")
    return (
        f"{result} {functions.name}_{function.name}_q31(const {number} in[{upper}_{given}], "
        f"{number} out[{upper}_{written}])"
    )


def _source_q31(fixed: FixedModel, command: str) -> str:
    """NAME_q31.c."""
    functions = fixed.functions
    name, upper = functions.name, functions.name.upper()
    tables = [_table("int8_t", f"{name}_in_bits_q31", f"{upper}_INPUTS", fixed.input_bits)]
    for one in fixed.of_inputs:
        size = f"{upper}_{SIZES[one.function.name][1]}"
        tables.append(_table("int8_t", f"{name}_{one.function.name}_bits_q31", size, one.made.result_bits))
    tables.append(_table("uint8_t", f"{name}_c_row_q31", f"{upper}_C", functions.c_row))
    tables.append(_table("uint8_t", f"{name}_c_column_q31", f"{upper}_C", functions.c_column))
    parts = [
        c_comment(banner(functions, command)),
        f'#include "{name}_q31.h"',
        "\n".join(tables),
        *(fixed_function(_signature_q31(functions, one.function), one.made, fixed.limits) for one in fixed.of_inputs),
        *(scaled_function(_signature_q31(functions, one), one.program) for one in fixed.of_parameters),
        _model_q31(functions),
    ]
    return "\n\n".join(parts) + "\n"


def _model_q31(functions: ModelFunctions) -> str:
    """NAME_model_q31."""
    name, upper = functions.name, functions.name.upper()
    positive = sum(1 << k for k, one in enumerate(functions.model.unknowns) if one.positive)
    several = len(functions.kinds) > 1
    ends = ", ".join(map(str, functions.kind_end))
    return "\n".join(
        [
            *([f"static const uint8_t kind_end[{upper}_KINDS] = {{{ends}}};"] if several else []),
            "static const pvid_scaled_model_q31 scaled = {",
            f"    .theta = {name}_theta_q31,",
            f"    .jacobian = {name}_jacobian_q31,",
            "    .adapter = &pvid_read_scaled_q31,",
            "};",
            "",
            f"const pvid_model_q31 {name}_model_q31 = {{",
            f"    .n_theta = {upper}_THETA,",
            f"    .n_p = {upper}_P,",
            *([f"    .n_kinds = {upper}_KINDS,"] if several else []),
            f"    .n_c = {upper}_C,",
            f"    .positive = {positive}u,",
            *(["    .kind_end = kind_end,"] if several else []),
            f"    .c_row = {name}_c_row_q31,",
            f"    .c_column = {name}_c_column_q31,",
            "    .scaled = &scaled,",
            "};",
        ]
    )


def _table(kind: str, name: str, size: str, values: tuple[int, ...]) -> str:
    return f"const {kind} {name}[{size}] = {{{', '.join(map(str, values))}}};"
