"""The generated C of a model as a library of this machine, and its results on many vectors at once."""

import ctypes
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp
from described import CHAIN, MOTOR, ODDLY_NAMED

from bench.kinds import KINDS
from pvid.codegen.build import files_of
from pvid.codegen.functions import Function, ModelFunctions, functions_of
from pvid.codegen.generated import GeneratedModel
from pvid.core.sources import INCLUDES, source
from pvid.models import mechanisms

VECTORS = 20_000
BY_HAND = {one.name: one for one in (MOTOR, CHAIN, ODDLY_NAMED)}
MODELS = (*BY_HAND, *KINDS)
WARNINGS = (
    *("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wcast-align", "-Wcast-qual", "-Wconversion", "-Wvla"),
    *("-Wdouble-promotion", "-Wfloat-equal", "-Wmissing-prototypes", "-Wshadow", "-Wstrict-prototypes", "-Wundef"),
)
# Calls a function on many vectors: f(n, in [n, inputs], out [n, outputs]).
_LOOP = """
#include "pvid/elementary_q31.h"
#define EVERY(name, type)                                                                                  \\
    void name(void (*f)(const type in[], type out[]), unsigned n, const type *in, unsigned inputs, type *out, \\
              unsigned outputs);                                                                           \\
    void name(void (*f)(const type in[], type out[]), unsigned n, const type *in, unsigned inputs, type *out, \\
              unsigned outputs)                                                                            \\
    {                                                                                                      \\
        for (unsigned k = 0; k < n; k++) {                                                                 \\
            f(&in[k * inputs], &out[k * outputs]);                                                         \\
        }                                                                                                  \\
    }
EVERY(every_f32, float)
EVERY(every_scaled, pvid_scaled_q31)
void every_fixed(bool (*f)(const int32_t in[], int32_t out[]), unsigned n, const int32_t *in, unsigned inputs,
                 int32_t *out, unsigned outputs, uint8_t *fits);
void every_fixed(bool (*f)(const int32_t in[], int32_t out[]), unsigned n, const int32_t *in, unsigned inputs,
                 int32_t *out, unsigned outputs, uint8_t *fits)
{
    for (unsigned k = 0; k < n; k++) {
        fits[k] = f(&in[k * inputs], &out[k * outputs]) ? 1u : 0u;
    }
}
"""
SCALED = np.dtype([("m", np.int32), ("e", np.int32)])

Float = npt.NDArray[np.float64]


@cache
def functions_by_name(name: str) -> ModelFunctions:
    """Of a shipped mechanism, or of one of described.py."""
    return functions_of(BY_HAND.get(name) or mechanisms.compiled_of(name))


class Generated:
    """The files of a model, compiled with the project's warnings as errors."""

    def __init__(self, functions: ModelFunctions, folder: Path) -> None:
        self.functions = functions
        self.files = files_of(GeneratedModel(functions.model, "test"))
        for name, text in {**self.files, "loop.c": _LOOP}.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        code = [
            folder / name
            for name in self.files
            if name.endswith(".c") and not name.endswith(("_test.c", "_weak_f32.c"))
        ]
        core = [
            source(f"{one}.c")
            for one in ("elementary_f32", "elementary_q31", "scaled_q31", "scaled_model_q31", "integer_q31")
        ]
        library = folder / "generated.so"
        options = ["-std=c99", "-O2", "-shared", "-fPIC", *WARNINGS, *INCLUDES, f"-I{folder}"]
        sources = map(str, [*code, folder / "loop.c", *core])
        subprocess.run(["gcc", *options, *sources, "-o", str(library), "-lm"], check=True)
        self.library = ctypes.CDLL(str(library))

    def run(self, loop: str, function: Function, core: str, given: npt.NDArray[Any], *more: npt.NDArray[Any]) -> Any:
        """Results [results, vectors] of NAME_FUNCTION_core for inputs [arguments, vectors]."""
        rows = np.ascontiguousarray(given.T)
        out = np.zeros((len(rows), len(function.labels)), rows.dtype)
        call = getattr(self.library, f"{self.functions.name}_{function.name}_{core}")
        width = [ctypes.c_void_p(one.ctypes.data) for one in (rows, out, *more)]
        getattr(self.library, loop)(call, len(rows), width[0], rows.shape[1], width[1], out.shape[1], *width[2:])
        return out.T


def vectors(functions: ModelFunctions, function: Function) -> Float:
    """Random inputs [arguments, VECTORS]: p within its range, signals within their reach."""
    random = np.random.default_rng(16)
    if function.name in ("theta", "jacobian"):
        low, high = zip(*[(one.low, one.high) for one in functions.model.unknowns], strict=True)
    else:
        low, high = zip(*[(-one.reach, one.reach) for one in functions.inputs], strict=True)
    return random.uniform(np.array(low)[:, None], np.array(high)[:, None], (len(low), VECTORS))


def exactly(functions: ModelFunctions, function: Function, given: Float) -> list[Float]:
    """The SymPy expressions in float64, each [vectors]."""
    symbols = [one.symbol for one in functions.inputs]
    if function.name in ("theta", "jacobian"):
        symbols = list(functions.model.p)
    marks = sp.symbols(f"mark:{len(symbols)}", real=True)
    inner = [one.subs(dict(zip(symbols, marks, strict=True))) for one in function.expressions]
    values = sp.lambdify(marks, inner, modules=[{"sgn": np.sign}, "numpy"])(*given)
    return [np.broadcast_to(one, given.shape[1:]) for one in values]
