"""NAME_test.c: the generated functions on given inputs against the bits of their twin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.codegen.banner import banner, c_comment
from pvid.codegen.files_f32 import SIZES
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.twin_file import loaded

VECTORS = 8

Float32 = npt.NDArray[np.float32]


def spread(low: Sequence[float], high: Sequence[float], count: int) -> npt.NDArray[np.float64]:
    """`count` points of a box, evenly spread and always the same, [entries, count]."""
    entry, point = np.arange(len(low)), np.arange(1, count + 1)
    golden = (np.sqrt(5.0) - 1) / 2
    share = (point * ((entry[:, None] + 1) * golden % 1) + 0.1 * entry[:, None]) % 1
    bottom = np.asarray(low, np.float64)[:, None]
    found: npt.NDArray[np.float64] = bottom + (np.asarray(high, np.float64)[:, None] - bottom) * share
    return found


def inputs_of(functions: ModelFunctions, function: Function, count: int = VECTORS) -> Float32:
    """Inputs for a function [arguments, count]: p within its range, signals within their reach."""
    if function.name in ("theta", "jacobian"):
        unknowns = functions.model.unknowns
        return spread([one.low for one in unknowns], [one.high for one in unknowns], count).astype(np.float32)
    reach = [one.reach for one in functions.inputs]
    return spread([-one for one in reach], reach, count).astype(np.float32)


def source(functions: ModelFunctions, command: str) -> str:
    """The program; it returns 0 if all bits are equal."""
    name, upper = functions.name, functions.name.upper()
    twin = loaded(functions)
    parts = [
        c_comment(
            [
                f"The functions of {name}.h on {VECTORS} inputs each, compared with the bits of their numpy twin.",
                "",
                *banner(functions, command),
            ]
        ),
        f'#include "{name}.h"\n\n#include <stdio.h>\n#include <string.h>',
        f"#define VECTORS {VECTORS}",
    ]
    checks = []
    for one in functions.functions:
        given = inputs_of(functions, one)
        expected = getattr(twin, one.name)(given)
        inputs, outputs = SIZES[one.name]
        parts += [
            _table(f"{one.name}_in", f"{upper}_{inputs}", given),
            _table(f"{one.name}_out", f"{upper}_{outputs}", expected),
        ]
        checks.append(
            f"    faults += faults_of({name}_{one.name}_f32, {one.name}_in[0], {upper}_{inputs}, {one.name}_out[0], "
            f"{upper}_{outputs});"
        )
    most = max(max(len(one.program.arguments), len(one.labels)) for one in functions.functions)
    parts += [
        f"#define LONGEST {most}",
        """\
/* How many results differ. */
static unsigned faults_of(void (*function)(const float in[], float out[]), const uint32_t *in, unsigned inputs,
                          const uint32_t *expected, unsigned outputs)
{
    unsigned faults = 0;
    for (unsigned k = 0; k < VECTORS; k++) {
        float given[LONGEST];
        float found[LONGEST];
        uint32_t bits[LONGEST];
        memcpy(given, &in[k * inputs], inputs * sizeof given[0]);
        function(given, found);
        memcpy(bits, found, outputs * sizeof found[0]);
        for (unsigned i = 0; i < outputs; i++) {
            faults += (bits[i] != expected[(k * outputs) + i]) ? 1u : 0u;
        }
    }
    return faults;
}""",
        "\n".join(
            [
                "int main(void)",
                "{",
                "    unsigned faults = 0;",
                *checks,
                f'    printf("{name}: %u results differ from the twin\\n", faults);',
                "    return (faults == 0u) ? 0 : 1;",
                "}",
            ]
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _table(name: str, width: str, values: Float32) -> str:
    """static const uint32_t name[VECTORS][width], one vector a row."""
    rows = [
        "    {" + ", ".join(f"0x{bits:08X}u" for bits in row) + "},"
        for row in np.ascontiguousarray(values.T).view(np.uint32).tolist()
    ]
    return "\n".join([f"static const uint32_t {name}[VECTORS][{width}] = {{", *rows, "};"])
