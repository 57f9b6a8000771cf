"""NAME_test.c: the generated functions on given inputs against the bits of their twin."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import numpy as np
import numpy.typing as npt

from pvid.codegen.c_text import banner, c_comment
from pvid.codegen.files_functions import SIZES
from pvid.codegen.fixed_model import FixedModel
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.twin_file import text
from pvid.twin.printer.program import loaded

VECTORS = 8

Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
Int = npt.NDArray[np.int64]

_FAULTS = """\
/* How many results differ. */
static unsigned faults_of{core}({result} (*function)(const {kind} in[], {kind} out[]), const {stored} *in,
                          unsigned inputs, const {stored} *expected, unsigned outputs)
{{
    unsigned faults = 0;
    for (unsigned k = 0; k < VECTORS; k++) {{
        {kind} given[LONGEST];
        {kind} found[LONGEST];
        {stored} bits[LONGEST];
        memcpy(given, &in[k * inputs], inputs * sizeof given[0]);
        {call}
        memcpy(bits, found, outputs * sizeof found[0]);
        for (unsigned i = 0; i < outputs; i++) {{
            faults += ({differs}) ? 1u : 0u;
        }}
    }}
    return faults;
}}"""
_PLACE = "expected[(k * outputs) + i]"
_CORES = {
    "_f32": {
        "result": "void",
        "kind": "float",
        "stored": "uint32_t",
        "call": "function(given, found);",
        "differs": f"bits[i] != {_PLACE}",
    },
    "_fixed": {
        "result": "bool",
        "kind": "int32_t",
        "stored": "int32_t",
        "call": "faults += function(given, found) ? 0u : 1u;",
        "differs": f"bits[i] != {_PLACE}",
    },
    "_scaled": {
        "result": "void",
        "kind": "pvid_scaled_q31",
        "stored": "pvid_scaled_q31",
        "call": "function(given, found);",
        "differs": f"(bits[i].m != {_PLACE}.m) || (bits[i].e != {_PLACE}.e)",
    },
}


def spread(low: Sequence[float], high: Sequence[float], count: int) -> Float:
    """`count` points of a box, evenly spread and always the same, [entries, count]."""
    entry, point = np.arange(len(low)), np.arange(1, count + 1)
    golden = (np.sqrt(5.0) - 1) / 2
    share = (point * ((entry[:, None] + 1) * golden % 1) + 0.1 * entry[:, None]) % 1
    bottom = np.asarray(low, np.float64)[:, None]
    found: Float = bottom + (np.asarray(high, np.float64)[:, None] - bottom) * share
    return found


def parameters_of(functions: ModelFunctions, count: int = VECTORS) -> Float:
    """Points p within its range [n_p, count]."""
    unknowns = functions.model.unknowns
    return spread([one.low for one in unknowns], [one.high for one in unknowns], count)


def inputs_of(functions: ModelFunctions, function: Function, count: int = VECTORS) -> Float32:
    """Inputs for a function [arguments, count]: p within its range, signals within their reach."""
    if SIZES[function.name][0] == "P":
        return parameters_of(functions, count).astype(np.float32)
    reach = [one.reach for one in functions.inputs]
    return spread([-one for one in reach], reach, count).astype(np.float32)


def fixed_inputs_of(fixed: FixedModel) -> Int:
    """Inputs within their limits [inputs, VECTORS]."""
    return np.rint(spread([-one for one in fixed.limits], fixed.limits, VECTORS)).astype(np.int64)


def scaled_of(values: Float) -> Int:
    """m and e of the nearest numbers of 30 digits [..., 2], of float64 [...]."""
    fraction, exponent = np.frexp(values)  # 1/2 <= |fraction| < 1, or 0
    m = np.rint(fraction * 2.0**30).astype(np.int64)
    full = np.abs(m) == 2**30
    return np.stack([np.where(full, m >> 1, m), np.where(m == 0, 0, exponent.astype(np.int64) - 30 + full)], axis=-1)


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_test.c, a program that returns 0 if all bits are equal."""
    functions, fixed = model.functions, model.fixed.made
    twin = loaded(text(model), f"{model.name}_twin.py")
    name = functions.name
    tables, checks = _float_cases(functions, twin)
    cores = ["_f32"]
    headers = [f'#include "{name}.h"']
    if fixed:
        more, others = _fixed_cases(fixed, twin)
        tables += more
        checks += others
        cores += ["_fixed", "_scaled"]
        headers.append(f'#include "{name}_q31.h"')
    longest = max(max(len(one.program.arguments), len(one.labels)) for one in functions.functions)
    about = [
        f"The functions of {name} on {VECTORS} inputs each, compared with the bits of their numpy twin.",
        "",
        *banner(functions, model.command),
    ]
    program = [
        f"unsigned {name}_faults(void);",
        "",
        "/* How many results of all functions differ. */",
        f"unsigned {name}_faults(void)",
        "{",
        "    unsigned faults = 0;",
        *(f"    faults += {check};" for check in checks),
        "    return faults;",
        "}",
        "",
        "/* 0 if all are equal. Define PVID_GENERATED_WITHOUT_MAIN for a program of your own, on a board. */",
        "#if !defined(PVID_GENERATED_WITHOUT_MAIN)",
        "int main(void)",
        "{",
        f"    return ({name}_faults() == 0u) ? 0 : 1;",
        "}",
        "#endif",
    ]
    parts = [
        c_comment(about),
        "\n".join([*headers, "", "#include <string.h>"]),
        f"#define VECTORS {VECTORS}\n#define LONGEST {longest}",
        *tables,
        *(_FAULTS.format(core=core, **_CORES[core]) for core in cores),
        "\n".join(program),
    ]
    return {f"{name}_test.c": "\n\n".join(parts) + "\n"}


def _float_cases(functions: ModelFunctions, twin: ModuleType) -> tuple[list[str], list[str]]:
    """Tables, and the calls that compare."""
    tables, checks = [], []
    for one in functions.functions:
        given = inputs_of(functions, one).T
        found = np.zeros((len(given), len(one.labels)), np.float32)
        with np.errstate(all="ignore"):
            for row, out in zip(given, found, strict=True):
                getattr(twin, f"{functions.name}_{one.name}_f32")(list(row), out)
        for word, values in (("in", given), ("out", found)):
            bits = np.ascontiguousarray(values).view(np.uint32).tolist()
            tables.append(
                _table(functions, one, word, "f32", "uint32_t", [[f"0x{x:08X}u" for x in row] for row in bits])
            )
        checks.append(_check(functions, one, "f32", "f32"))
    return tables, checks


def _fixed_cases(fixed: FixedModel, twin: ModuleType) -> tuple[list[str], list[str]]:
    functions = fixed.functions
    tables, checks = [], []
    counts = fixed_inputs_of(fixed).T.tolist()
    for case in fixed.of_inputs:
        one = case.function
        found = [[0] * len(one.labels) for _ in counts]
        for row, out in zip(counts, found, strict=True):
            assert getattr(twin, f"{functions.name}_{one.name}_q31")(row, out)
        for word, values in (("in", counts), ("out", found)):
            rows = [[str(x) for x in row] for row in values]
            tables.append(_table(functions, one, word, "q31", "int32_t", rows))
        checks.append(_check(functions, one, "q31", "fixed"))
    number = twin.pvid_scaled_q31
    p = [[number(*one) for one in row] for row in scaled_of(parameters_of(functions).T).tolist()]
    for one in fixed.of_parameters:
        results = [[number() for _ in one.labels] for _ in p]
        for given, out in zip(p, results, strict=True):
            getattr(twin, f"{functions.name}_{one.name}_q31")(given, out)
        for word, numbers in (("in", p), ("out", results)):
            rows = [[f"{{{x.m}, {x.e}}}" for x in row] for row in numbers]
            tables.append(_table(functions, one, word, "q31", "pvid_scaled_q31", rows))
        checks.append(_check(functions, one, "q31", "scaled"))
    return tables, checks


def _table(functions: ModelFunctions, one: Function, word: str, core: str, kind: str, rows: list[list[str]]) -> str:
    """static const kind NAME_in_f32[VECTORS][width], one vector a row."""
    width = f"{functions.name.upper()}_{SIZES[one.name][0 if word == 'in' else 1]}"
    lines = ["    {" + ", ".join(row) + "}," for row in rows]
    return "\n".join([f"static const {kind} {one.name}_{word}_{core}[VECTORS][{width}] = {{", *lines, "};"])


def _check(functions: ModelFunctions, one: Function, core: str, kind: str) -> str:
    upper = functions.name.upper()
    given, written = SIZES[one.name]
    tables = [f"{one.name}_{word}_{core}[0]" for word in ("in", "out")]
    call = f"{functions.name}_{one.name}_{core}"
    return f"faults_of_{kind}({call}, {tables[0]}, {upper}_{given}, {tables[1]}, {upper}_{written})"
