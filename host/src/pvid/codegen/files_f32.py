"""The float32 files of a model: header and source."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.codegen import c_f32, describe
from pvid.codegen.banner import banner, c_comment
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.generated import GeneratedModel

UNCONTRACTED = """\
/* No fused multiply-add in this file, whatever the compiler's options: it would change the bits. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif"""

# Sizes of what each function is given and writes, as in NAME_P.
SIZES = {
    "integrands": ("INPUTS", "INTEGRANDS"),
    "channels": ("INPUTS", "CHANNELS"),
    "theta": ("P", "THETA"),
    "jacobian": ("P", "C"),
}


MEANING = {
    "integrands": "From the inputs: what is integrated for the inputs that are integrals.",
    "channels": "From the inputs of one instant: the channels.",
    "theta": "From p: theta.",
    "jacobian": "From p: the non-zeros of d theta / d p by columns, in the order of c_row and c_column.",
}


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_sizes.h, NAME.h and NAME_f32.c."""
    functions, name = model.functions, model.name
    return {
        f"{name}_sizes.h": sizes(functions, model.command),
        f"{name}.h": header(functions, model.command),
        f"{name}_f32.c": source(functions, model.command),
    }


def sizes(functions: ModelFunctions, command: str) -> str:
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
    about = [
        f"{name}_sizes.h - how many parameters, coefficients and channels {name} has.",
        "",
        *banner(functions, command),
    ]
    defined = [f"#define {upper}_{what} {count}" for what, count in counts.items()]
    return guarded(f"{name}_sizes", about, defined)


def guarded(name: str, about: list[str], body: list[str]) -> str:
    """A header of this text."""
    guard = f"PVID_GENERATED_{name.upper()}_H"
    return "\n".join([c_comment(about), f"#ifndef {guard}", f"#define {guard}", "", *body, "", "#endif", ""])


def for_cpp(body: list[str]) -> list[str]:
    """Declarations that C++ reads as C."""
    return ["#ifdef __cplusplus", 'extern "C" {', "#endif", "", *body, "#ifdef __cplusplus", "}", "#endif"]


def header(functions: ModelFunctions, command: str) -> str:
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
        lines += [
            f"/* {MEANING[function.name]} {function.program.cost}. */",
            f"{signature(functions, function)};",
            "",
        ]
    return lines


def signature(functions: ModelFunctions, function: Function) -> str:
    """As in the header."""
    upper = functions.name.upper()
    given, written = SIZES[function.name]
    return f"void {functions.name}_{function.name}_f32(const float in[{upper}_{given}], float out[{upper}_{written}])"


def source(functions: ModelFunctions, command: str) -> str:
    """NAME_f32.c."""
    name = functions.name
    parts = [
        c_comment(banner(functions, command)),
        UNCONTRACTED,
        includes_of(f"{name}.h", functions.functions),
        *(c_f32.function(signature(functions, one), one.program) for one in functions.functions),
        model_struct(functions, f"{name}_theta_f32", f"{name}_jacobian_f32"),
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


def model_struct(functions: ModelFunctions, theta: str, jacobian: str) -> str:
    """The pattern and NAME_model_f32, with these functions."""
    name, upper = functions.name, functions.name.upper()
    positive = sum(1 << k for k, one in enumerate(functions.model.unknowns) if one.positive)
    several = len(functions.kinds) > 1
    ends = ", ".join(map(str, functions.kind_end))
    return "\n".join(
        [
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
            f"    .theta = {theta},",
            f"    .jacobian = {jacobian},",
            "};",
        ]
    )
