"""The generated row of the strong form is the weak form's equation without integration by parts."""

import random

import pytest
import sympy as sp

from bench.kinds import KINDS
from pvid.codegen.functions import with_values
from pvid.codegen.strong import strong_functions_of
from pvid.model import Model, sgn
from pvid.model.compiled import Row
from pvid.model.signals import jets, total_derivative
from pvid.model.strong import strong_form
from pvid.models import mechanisms

# Kapitza's pendulum is multiplied by its denominators: test_strong_model.py compares it with the core's row. The cell's
# charge is an integral since the start of the run.
SAME = [name for name in KINDS if name not in ("kapitza", "battery_2rc")]


def residual(row: Row) -> sp.Expr:
    """theta N - Y as one expression in jets, every sign constant."""
    parts = [(theta, part) for theta, part in zip(row.theta, row.regressors, strict=True)]
    parts.append((sp.Integer(-1), row.known))
    total = sp.Integer(0)
    for factor, part in parts:
        for order, psi in part.items():
            signs = {one: sp.Dummy() for one in sp.sympify(psi).atoms(sgn)}
            back = {mark: one for one, mark in signs.items()}
            total += factor * total_derivative(sp.sympify(psi).xreplace(signs), order).xreplace(back)
    return total


@pytest.mark.parametrize("name", SAME)
def test_the_residuals_are_those_of_the_weak_rows(name: str) -> None:
    """At random rationals; a row may have the other sign or another scale, which is the same for all jets."""
    weak = mechanisms.compiled_of(name)
    strong = strong_functions_of(strong_form(weak))
    theta, columns = strong.functions.theta.expressions, strong.row.expressions
    chance = random.Random(5)
    for kind, other in zip(strong.functions.kinds, weak.rows, strict=True):
        own = columns[kind.columns.start : kind.known]
        ours = sum((theta[k] * n for k, n in zip(kind.theta, own, strict=True)), -columns[kind.known])
        theirs = with_values(weak, residual(other))
        p = {symbol: sp.Rational(chance.randint(2, 30), chance.randint(2, 30)) for symbol in weak.p}
        ratios = []
        for _ in range(3):
            both = sorted(jets(ours) | jets(theirs), key=str)
            at = {jet: sp.Rational(chance.randint(-30, 30), chance.randint(2, 30)) for jet in both}
            a, b = (sp.N(e.xreplace(p).xreplace(at).replace(sgn, sp.sign), 30) for e in (ours, theirs))
            ratios.append(a / b)
        assert max(abs(ratio - ratios[0]) for ratio in ratios) < 1e-20


def test_a_sign_is_constant_under_a_derivative() -> None:
    """Eliminating the hidden coordinate differentiates the friction; between reversals its rate is 0."""
    model = Model("hidden load")
    f, x = model.input("f", "N", hold="sampled"), model.sensor("x", "m", resolution=1e-3)
    y = model.unmeasured("y", "m")
    m, k = model.unknown("m", "kg", 1.0), model.unknown("k", "N/m", 2.0)
    c, friction = model.unknown("c", "N*s/m", 0.3), model.unknown("friction", "N*s/m", 0.1)
    model.equation(m * x.d(2) + friction * sgn(x.d()) * abs(x.d()) + k * (x - y) - f)
    model.equation(c * y.d() - k * (x - y))
    strong = strong_functions_of(strong_form(model.compiled("hidden")))
    assert [one.name for one in strong.functions.inputs] == ["f", "f_1", "x_1", "x_2", "x_3"]
    # d/dt (sgn(x') |x'|) = sgn(x')^2 x''
    rate = sgn(x.d()) ** 2 * x.d(2)
    assert any(one in (rate, -rate) for one in map(sp.expand, strong.row.expressions))
