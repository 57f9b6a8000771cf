"""Generated float32: C and numpy give the same bits, and the values of the SymPy expressions within rounding."""

from __future__ import annotations

import ctypes
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from described import CHAIN, MOTOR
from rounding import bounds_of

from pvid.base.errors import PvidError
from pvid.codegen import files_f32, twin_file
from pvid.codegen.functions import Function, ModelFunctions, functions_of, with_values
from pvid.codegen.names import identifiers
from pvid.codegen.operations import exact, program_of
from pvid.core.sources import INCLUDES, source
from pvid.model.signals import Integral, Jet, sgn
from pvid.models import mechanisms

VECTORS = 20_000
MODELS = (MOTOR.name, CHAIN.name, *mechanisms.names())
WARNINGS = (
    *("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wcast-align", "-Wcast-qual", "-Wconversion", "-Wvla"),
    *("-Wdouble-promotion", "-Wfloat-equal", "-Wmissing-prototypes", "-Wshadow", "-Wstrict-prototypes", "-Wundef"),
)
# Calls a function on many vectors: f(n, in [n, inputs], out [n, outputs]).
LOOP = """
void every(void (*f)(const float in[], float out[]), unsigned n, const float *in, unsigned inputs, float *out,
           unsigned outputs);
void every(void (*f)(const float in[], float out[]), unsigned n, const float *in, unsigned inputs, float *out,
           unsigned outputs)
{
    for (unsigned k = 0; k < n; k++) {
        f(&in[k * inputs], &out[k * outputs]);
    }
}
"""

Float32 = npt.NDArray[np.float32]


def rational(value: Fraction) -> sp.Rational:
    return sp.Rational(value.numerator, value.denominator)


def compiled_c(functions: ModelFunctions, folder: Path) -> ctypes.CDLL:
    """The generated C as a library, with the project's warnings as errors."""
    header, code, loop = folder / f"{functions.name}.h", folder / "generated.c", folder / "loop.c"
    header.write_text(files_f32.header(functions, "test"), encoding="utf-8")
    code.write_text(files_f32.source(functions, "test"), encoding="utf-8")
    loop.write_text(LOOP, encoding="utf-8")
    library = folder / "generated.so"
    command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "-DPVID_PLAIN_NAMES", *WARNINGS, *INCLUDES, f"-I{folder}"]
    sources = [code, loop, source("elementary_f32.c")]
    subprocess.run([*command, *map(str, sources), "-o", str(library), "-lm"], check=True)
    subprocess.run(["g++", "-fsyntax-only", "-Wall", "-Wextra", "-x", "c++", *INCLUDES, str(header)], check=True)
    return ctypes.CDLL(str(library))


def by_c(library: ctypes.CDLL, functions: ModelFunctions, function: Function, given: Float32) -> Float32:
    """Results [results, vectors] of the generated C."""
    rows = np.ascontiguousarray(given.T)
    out = np.empty((len(rows), len(function.labels)), np.float32)
    call = getattr(library, f"{functions.name}_{function.name}_f32")
    library.every(
        call,
        len(rows),
        ctypes.c_void_p(rows.ctypes.data),
        rows.shape[1],
        ctypes.c_void_p(out.ctypes.data),
        out.shape[1],
    )
    return out.T


def vectors(functions: ModelFunctions, function: Function) -> Float32:
    """Random inputs [arguments, VECTORS]: p within its range, signals within their reach."""
    random = np.random.default_rng(16)
    if function.name in ("theta", "jacobian"):
        low, high = zip(*[(one.low, one.high) for one in functions.model.unknowns], strict=True)
    else:
        low, high = zip(*[(-one.reach, one.reach) for one in functions.inputs], strict=True)
    drawn = random.uniform(np.array(low)[:, None], np.array(high)[:, None], (len(low), VECTORS))
    return drawn.astype(np.float32)


@pytest.fixture(scope="module", params=MODELS)
def functions(request: pytest.FixtureRequest) -> ModelFunctions:
    by_hand = {one.name: one for one in (MOTOR, CHAIN)}
    return functions_of(by_hand.get(request.param) or mechanisms.compiled_of(request.param))


def test_c_and_twin_have_the_same_bits(functions: ModelFunctions, tmp_path: Path) -> None:
    library, twin = compiled_c(functions, tmp_path), twin_file.loaded(functions)
    for function in functions.functions:
        given = vectors(functions, function)
        want = getattr(twin, function.name)(given)
        got = by_c(library, functions, function, given)
        assert want.dtype == np.float32 and np.isfinite(want).all()
        assert (got.view(np.uint32) == want.view(np.uint32)).all(), function.name


def test_values_are_those_of_the_expressions_within_rounding(functions: ModelFunctions) -> None:
    """The bound is that of float32's rounding through the list of operations, with no margin."""
    twin = twin_file.loaded(functions)
    for function in functions.functions:
        given = vectors(functions, function)
        found = getattr(twin, function.name)(given)
        symbols = [one.symbol for one in functions.inputs]
        if function.name in ("theta", "jacobian"):
            symbols = list(functions.model.p)
        marks = sp.symbols(f"mark:{len(symbols)}", real=True)
        inner = [one.subs(dict(zip(symbols, marks, strict=True))) for one in function.expressions]
        exact = sp.lambdify(marks, inner, modules=[{"sgn": np.sign}, "numpy"])(*given.astype(np.float64))
        bounds = bounds_of(function.program, given)
        for label, value, right, bound in zip(function.labels, found, exact, bounds, strict=True):
            assert (np.abs(value - right) <= bound).all(), label
            # the bound itself is one of float32
            assert np.median(bound / np.maximum(np.abs(right), 1e-30)) < 1e-4, label


def test_lanes_of_any_shape_have_the_bits_of_one(functions: ModelFunctions) -> None:
    twin = twin_file.loaded(functions)
    given = vectors(functions, functions.channels)[:, :12]
    whole = twin.channels(given)
    assert (twin.channels(given.reshape(-1, 3, 4)).reshape(whole.shape) == whole).all()
    assert (twin.channels(given[:, 5]) == whole[:, 5]).all()


def test_the_terms_make_the_columns_of_the_rows(functions: ModelFunctions) -> None:
    """Their sum by order is each regressor, Y and nuisance of the model."""
    model = functions.model
    columns = [part for row in model.rows for part in (*row.regressors, row.known, *row.nuisances)]
    assert len(columns) == functions.columns
    for number, part in enumerate(columns):
        for order in range(functions.top + 1):
            mine = [one for one in functions.terms if one.column == number and one.order == order]
            channels = functions.channels.expressions
            total = sum((rational(one.factor) * channels[one.channel] for one in mine), sp.Integer(0))
            # an integral since the start of the run is an input of its own name
            runs = {jet: sp.Symbol(jet.of, real=True) for jet, one in model.opaque.items() if one.has(Integral)}
            wanted = sp.sympify(part.get(order, 0)).xreplace({**model.opaque, **runs})
            wanted = with_values(model, wanted).xreplace({sp.pi: rational(exact(sp.pi))})
            assert sp.expand(total - wanted) == 0
    for kind, row in zip(functions.kinds, model.rows, strict=True):
        assert len(kind.theta) == len(row.theta) and kind.nuisances == len(row.nuisances)
        assert columns[kind.known] == row.known


def test_the_pattern_is_that_of_the_jacobian() -> None:
    functions = functions_of(MOTOR)
    # R is in theta 0, 5, 6; L in 1, 5; k in 2, 3; J in 4, 5; c in 5, 6
    assert functions.c_column == (0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4)
    assert functions.c_row == (0, 5, 6, 1, 5, 2, 3, 4, 5, 5, 6)


def test_equal_values_are_computed_once_and_powers_are_products() -> None:
    x, y = sp.symbols("x y", real=True)
    program = program_of([x, y], [x * y, y * x + 1, x**4, (x * y) / 3])
    assert program.operations == 5  # x y, + 1, x^2, x^4, times a third
    assert program.kinds == {"*", "+"}


def test_a_soft_sign_replaces_a_plain_one_where_it_has_a_width() -> None:
    speed = Jet("phi", 1)
    hard, soft = program_of([speed], [sgn(speed)]), program_of([speed], [sgn(speed)], widths={speed: 0.5})
    assert hard.kinds == {"sign"} and soft.kinds == {"soft_sign"}


def test_signs_can_be_inputs() -> None:
    functions = functions_of(MOTOR, signs_are_inputs=True)
    assert functions.inputs[-1].name == "sign_0"
    assert "sign" not in functions.channels.program.kinds


def test_what_has_no_c_is_refused_in_words() -> None:
    x, y = sp.symbols("x y", real=True)
    with pytest.raises(PvidError, match=r"exp\(x\) cannot be generated: the functions are sin, cos"):
        program_of([x], [sp.exp(x)])
    with pytest.raises(PvidError, match=r"y has no value"):
        program_of([x], [x + y])
    with pytest.raises(PvidError, match=r"powers are integers or halves"):
        program_of([x], [x ** sp.Rational(1, 3)])


def test_names_are_names_in_every_language() -> None:
    names = identifiers(["double", "out", "a b", "3d", "lambda", "a_b", "phi'", "pvid_weak", "θ"])
    assert names == ["double_", "out_", "a_b", "s_3d", "lambda_", "a_b_2", "phi", "pvid_weak_", "symbol"]
    assert len(set(names)) == len(names)
