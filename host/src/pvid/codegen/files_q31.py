"""The fixed-point files of a model: header and source. No floating point in them."""

from __future__ import annotations

from pvid.codegen import c_q31, describe
from pvid.codegen.banner import banner, c_comment
from pvid.codegen.files_f32 import MEANING, SIZES, for_cpp, guarded
from pvid.codegen.fixed_model import FixedModel
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.generated import GeneratedModel


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_q31.h and NAME_q31.c, where fixed point can compute all functions."""
    fixed, name = model.fixed.made, model.name
    if fixed is None:
        return {}
    return {f"{name}_q31.h": header(fixed, model.command), f"{name}_q31.c": source(fixed, model.command)}


def header(fixed: FixedModel, command: str) -> str:
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
            f"{signature(functions, what)};",
            "",
        ]
    for what in fixed.of_parameters:
        lines += [
            f"/* {MEANING[what.name]} {what.program.cost}. */",
            f"{signature(functions, what)};",
            "",
        ]
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


def signature(functions: ModelFunctions, function: Function) -> str:
    """As in the header."""
    upper = functions.name.upper()
    given, written = SIZES[function.name]
    result, number = ("void", "pvid_scaled_q31") if given == "P" else ("bool", "int32_t")
    return (
        f"{result} {functions.name}_{function.name}_q31(const {number} in[{upper}_{given}], "
        f"{number} out[{upper}_{written}])"
    )


def source(fixed: FixedModel, command: str) -> str:
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
        *(c_q31.fixed_function(signature(functions, one.function), one.made, fixed.limits) for one in fixed.of_inputs),
        *(c_q31.scaled_function(signature(functions, one), one.program) for one in fixed.of_parameters),
        _model(functions),
    ]
    return "\n\n".join(parts) + "\n"


def _model(functions: ModelFunctions) -> str:
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
