"""Expressions that nobody chose: C and its printed twin give the same bits, and the values within rounding."""

import ctypes
import random
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp
from generated import WARNINGS
from rounding import FLOAT32, bounds_of, fixed_bounds_of

from pvid.codegen import c_functions
from pvid.codegen.formats import bits_of, fixed
from pvid.core.sources import FOLDERS, INCLUDES, source
from pvid.model.operations import program_of
from pvid.model.signals import sgn
from pvid.twin.printer.program import printed_module

COUNT, VECTORS, PRINTED = 60, 500, 40  # expressions, vectors, vectors of the twin
NAMES = sp.symbols("q1 q2 v1 u", real=True)
REACH = (3.0, 40.0, 900.0, 0.02)
HEAD_C = """
#include "pvid/elementary.h"
#include "pvid/elementary_q31.h"
"""

Float = npt.NDArray[np.float64]


def expression(chance: random.Random, depth: int) -> sp.Expr:
    """Of + - * / sin cos sgn abs and constants; divisors stay away from 0."""
    if depth == 0 or chance.random() < 0.15:
        return chance.choice([*NAMES, sp.Rational(chance.randint(-40, 40) or 1, chance.randint(1, 9))])
    inner = [expression(chance, depth - 1) for _ in range(2)]
    makers: list[Callable[[sp.Expr, sp.Expr], sp.Expr]] = [
        lambda a, b: a + b,
        lambda a, b: a - b,
        lambda a, b: a * b,
        lambda a, b: a * NAMES[chance.randrange(4)],
        lambda a, _: sp.sin(NAMES[chance.randrange(2)] + a / 1000),
        lambda a, _: sp.cos(NAMES[chance.randrange(2)]) * a,
        lambda a, b: a / (sp.Rational(5, 2) + sp.sin(NAMES[chance.randrange(4)])),
        lambda a, b: sgn(NAMES[chance.randrange(4)]) * a,
        lambda a, b: sp.Abs(a) + b,
        lambda a, b: NAMES[chance.randrange(4)] ** chance.randint(2, 3),
    ]
    return chance.choice(makers)(*inner)


class Case:
    """An expression, its lists and formats."""

    def __init__(self, number: int, whole: sp.Expr) -> None:
        self.number, self.whole = number, whole
        self.program = program_of(NAMES, [whole])
        self.fixed = fixed(self.program, [(-one, one) for one in REACH], "random")

    @property
    def code(self) -> str:
        """In C: f in float, g in integers."""
        floats = f"void f_{self.number}(const float in[], float out[])"
        integers = f"bool g_{self.number}(const int32_t in[], int32_t out[])"
        limits = [2**30] * len(NAMES)
        return "\n".join(
            [
                f"{floats};\n{integers};",
                c_functions.float_function(floats, self.program),
                c_functions.fixed_function(integers, self.fixed, limits),
            ]
        )

    def exactly(self, given: Float) -> Float:
        """In float64."""
        found = sp.lambdify(NAMES, self.whole, modules=[{"sgn": np.sign}, "numpy"])(*given)
        return np.broadcast_to(np.asarray(found, np.float64), given.shape[1:])


def each(library: ctypes.CDLL, name: str, given: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The result [vectors] of a function in C."""
    rows = np.ascontiguousarray(given.T)
    out = np.empty(len(rows), rows.dtype)
    for k, row in enumerate(rows):
        place = ctypes.c_void_p(out.ctypes.data + k * out.itemsize)
        getattr(library, name)(ctypes.c_void_p(row.ctypes.data), place)
    return out


def test_random_expressions(tmp_path: Path) -> None:
    chance = random.Random(2026)
    cases = [Case(k, expression(chance, 4)) for k in range(COUNT)]
    assert {kind for one in cases for kind in one.program.kinds} >= {"+", "-", "*", "/", "sin", "cos", "sign", "abs"}
    (tmp_path / "random.c").write_text("\n".join([HEAD_C, *(one.code for one in cases)]), encoding="utf-8")
    core = [
        source(f"{one}.c")
        for one in ("elementary_f32", "elementary_q31", "scaled_q31", "scaled_model_q31", "integer_q31")
    ]
    options = ["-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", *WARNINGS, *INCLUDES]
    sources = [str(tmp_path / "random.c"), *map(str, core)]
    subprocess.run(["gcc", *options, *sources, "-o", str(tmp_path / "random.so"), "-lm"], check=True)
    library = ctypes.CDLL(str(tmp_path / "random.so"))
    code = (tmp_path / "random.c").read_text(encoding="utf-8")
    names = [f"{kind}_{k}" for kind in "fg" for k in range(COUNT)]
    twin = printed_module(core, FOLDERS, {}, names, {"random.c": code})
    drawn = np.random.default_rng(5).uniform(-1, 1, (len(NAMES), VECTORS)) * np.array(REACH)[:, None]
    floats = drawn.astype(np.float32)
    places = np.array([bits_of((-one, one)) for one in REACH])[:, None]
    integers = np.rint(drawn * 2.0**places).astype(np.int32)
    for one in cases:
        found, counts = each(library, f"f_{one.number}", floats), each(library, f"g_{one.number}", integers)
        for k in range(PRINTED):
            own, other = [np.float32(0)], [0]
            getattr(twin, f"f_{one.number}")(list(floats[:, k]), own)
            assert np.float32(own[0]).tobytes() == found[k].tobytes(), one.whole
            assert getattr(twin, f"g_{one.number}")(integers[:, k].tolist(), other) and other[0] == counts[k], one.whole
        given = floats.astype(np.float64)
        bound = bounds_of(one.program, given, FLOAT32)[0]
        assert (np.abs(found - one.exactly(given)) <= bound).all(), one.whole
        given = integers * 2.0**-places
        bound = fixed_bounds_of(one.fixed, given)[0]
        assert (np.abs(counts * 2.0 ** -one.fixed.result_bits[0] - one.exactly(given)) <= bound).all(), one.whole
