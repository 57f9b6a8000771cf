"""Generated float32: the values of the SymPy expressions within rounding, in C and in its printed twin."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from described import MOTOR
from generated import MODELS, Generated, exactly, functions_by_name, vectors
from rounding import FLOAT32, bounds_of

from pvid.base.errors import PvidError
from pvid.codegen.functions import ModelFunctions, functions_of, identifiers, with_values
from pvid.model.operations import exact, program_of
from pvid.model.signals import Integral, Jet, sgn
from pvid.twin.printer.program import loaded

PRINTED = 200  # vectors of the twin


def rational(value: Fraction) -> sp.Rational:
    return sp.Rational(value.numerator, value.denominator)


@pytest.fixture(scope="module", params=MODELS)
def functions(request: pytest.FixtureRequest) -> ModelFunctions:
    return functions_by_name(request.param)


def test_values_are_those_of_the_expressions_within_rounding(functions: ModelFunctions, tmp_path: Path) -> None:
    """The bound is that of float32's rounding through the list of operations, with no margin; some of the vectors
    have the bits of the printed twin."""
    generated = Generated(functions, tmp_path)
    twin = loaded(generated.files[f"{functions.name}_twin.py"], "twin")
    for function in functions.functions:
        given = vectors(functions, function).astype(np.float32)
        found, exact64 = generated.run("every_f32", function, "f32", given), given.astype(np.float64)
        bounds = bounds_of(function.program, exact64, FLOAT32)
        right = exactly(functions, function, exact64)
        for label, value, wanted, bound in zip(function.labels, found, right, bounds, strict=True):
            assert (np.abs(value - wanted) <= bound).all(), label
            # the bound itself is one of float32
            assert np.median(bound / np.maximum(np.abs(wanted), 1e-30)) < 1e-4, label
        for vector, row in zip(given.T[:PRINTED], found.T[:PRINTED], strict=True):
            out = [np.float32(0)] * len(row)
            getattr(twin, f"{functions.name}_{function.name}_f32")(list(vector), out)
            assert np.array(out, np.float32).tobytes() == row.tobytes(), function.name


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
    hard, soft = program_of([speed], [sgn(speed)]), program_of([speed], [sgn(speed)], widths={"phi_1": 0.5})
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
