"""Lowering is an identity, and moves every derivative that can be moved."""

import random

import pytest
import sympy as sp

from pvid.model import Model, cos, sgn, sin
from pvid.model.compiled import Row
from pvid.model.lower import lower
from pvid.model.signals import Jet, jets, order_of, total_derivative
from pvid.model.zero import is_zero

Q1, Q2, A = Jet("q1"), Jet("q2"), Jet("a")


@pytest.mark.parametrize(
    ("expression", "parts"),
    [
        (cos(Q2) * Q1.d(2), {1: cos(Q2) * Q1.d(), 0: sin(Q2) * Q1.d() * Q2.d()}),
        (cos(A) * A.d(2) - sin(A) * A.d() ** 2, {2: sin(A)}),
        (sin(Q2) ** 2 * Q1.d(2) + 2 * sin(Q2) * cos(Q2) * Q1.d() * Q2.d(), {1: sin(Q2) ** 2 * Q1.d()}),
        (Q1 * Q2.d(2) + Q2 * Q1.d(2) + 2 * Q1.d() * Q2.d(), {2: Q1 * Q2}),
        (3 * Q1.d(4) - Q1.d() + 2, {4: 3 * Q1, 1: -Q1, 0: 2}),
        (Q1.d() / Q1**2, {1: -1 / Q1}),
    ],
)
def test_the_known_forms_are_found(expression: sp.Expr, parts: dict[int, sp.Expr]) -> None:
    found = lower(expression)
    assert set(found) == set(parts)
    assert all(sp.expand(found[m] - psi) == 0 for m, psi in parts.items())


def test_by_parts_moves_the_derivative_of_the_chosen_signal() -> None:
    assert lower(cos(A) * Q1.d()) == {0: cos(A) * Q1.d()}
    assert lower(cos(A) * Q1.d(), by_parts="q1") == {1: Q1 * cos(A), 0: Q1 * A.d() * sin(A)}


def random_expression(source: random.Random, order: int) -> sp.Expr:
    """Products of sines, powers and jets of two signals."""
    functions = [sin(Q1), cos(Q1), sin(Q2), cos(Q2), sin(Q1 - Q2), cos(Q1 + Q2), Q1, Q2, Q1**2, sp.Integer(1)]
    total = sp.Integer(0)
    for _ in range(source.randint(1, 4)):
        term = sp.Integer(source.choice([-3, -2, -1, 1, 2]))
        for _ in range(source.randint(0, 2)):
            term *= source.choice(functions)
        for _ in range(source.randint(0, 2)):
            term *= source.choice([Q1, Q2]).d(source.randint(1, order))
        total += term
    return total


@pytest.mark.parametrize("seed", range(60))
def test_any_expression_is_the_sum_of_its_parts(seed: int) -> None:
    source = random.Random(seed)
    expression = random_expression(source, 3)
    parts = lower(expression, by_parts=source.choice(["", "q1", "q2"]))
    assert is_zero(sum(total_derivative(psi, m) for m, psi in parts.items()) - expression)


@pytest.mark.parametrize("seed", range(30))
def test_a_derivative_of_anything_is_undone(seed: int) -> None:
    """D^m of a function of the signals alone, products of sines of one or of two angles, comes back of order 0."""
    source = random.Random(seed)
    m = source.randint(1, 2)
    psi = source.choice([sin(Q1) * Q2, cos(Q1), Q1**2 * Q2, sin(Q1) * cos(Q2), Q1 + 3 * Q2, sin(Q1 + Q2), Q1 * Q2])
    parts = lower(total_derivative(psi, m))
    assert all(order_of(one) == 0 for one in parts.values())
    assert is_zero(parts[m] - psi) or is_zero(sp.diff(parts[m] - psi, Q1)) and is_zero(sp.diff(parts[m] - psi, Q2))


def rates(row: Row) -> sp.Expr:
    """sum theta N - Y in jets; sgn(..) is put back as a signal of its own."""
    marks = {one: Jet(f"s{k}") for k, one in enumerate(sorted(_signs(row), key=str))}

    def rate(part: dict[int, sp.Expr]) -> sp.Expr:
        return sum((total_derivative(psi.xreplace(marks), m) for m, psi in part.items()), sp.Integer(0))

    total = sum(theta * rate(dict(part)) for theta, part in zip(row.theta, row.regressors, strict=True))
    return sp.expand(total - rate(dict(row.known))).xreplace({mark: one for one, mark in marks.items()})


def _signs(row: Row) -> set[sp.Expr]:
    parts = (*row.regressors, row.known)
    return {one for part in parts for psi in part.values() for one in psi.atoms(sgn)}


@pytest.mark.parametrize("seed", range(12))
def test_rows_of_random_lagrangians_are_their_equations(seed: int) -> None:
    """Two coordinates, sines, cosines, products, friction: sum theta N - Y is the equation of motion, up to its sign;
    first derivatives at most."""
    source = random.Random(seed)
    model = Model("random")
    q1, q2 = (model.sensor(name, "", noise=1e-3) for name in ("q1", "q2"))
    u1, u2 = (model.input(name, "1/s^2", hold="zoh") for name in ("u1", "u2"))
    angles = [sin(q1), cos(q1), sin(q2), cos(q2), cos(q1 - q2), sin(q1 + q2), sp.Integer(1), q1**2]
    lagrangian = sp.Integer(0)
    for k, speeds in enumerate((q1.d() ** 2, q2.d() ** 2, q1.d() * q2.d())):
        for n in range(source.randint(1, 2)):
            lagrangian += model.unknown(f"m{k}{n}", "", 1.0) * source.choice(angles) * source.choice(angles) * speeds
    for k in range(source.randint(1, 3)):
        lagrangian -= model.unknown(f"g{k}", "1/s^2", 1.0) * source.choice(angles) * source.choice(angles)
    b, c = model.unknown("b", "1/s", 1.0), model.unknown("c", "1/s^2", 1.0)
    model.lagrange(lagrangian, [q1, q2], [u1 - b * q1.d(), u2 - c * sgn(q2.d())])
    try:
        compiled = model.compiled()
    except Exception as error:  # an unknown that drops out of the Lagrangian is refused by name
        assert "no row contains the unknown" in str(error)
        return
    for row, equation in zip(compiled.rows, compiled.equations, strict=True):
        assert is_zero(rates(row) - equation) or is_zero(rates(row) + equation)
        psis = [psi for part in (*row.regressors, row.known) for psi in part.values()]
        assert max(jet.order for psi in psis for jet in jets(psi)) <= 1
