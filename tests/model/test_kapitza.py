"""The compiled pendulum has the rows, theta and Jacobian of the hand-made one, and the paper's strong form."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from pvid.design.weak import WeakDesign, design
from pvid.model import Model
from pvid.model.compiled import CompiledModel, Part
from pvid.model.signals import TIME, Integral, Jet
from pvid.model.strong import strong_form
from pvid.models.mechanisms import compiled_of
from pvid.oracle import weak
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate

Float = np.ndarray
ORDER = ("d1", "d1*w", "d2", "d2*w", "d2*w**2", "c*d2", "c*d2*w", "c*d2*w**2")  # of the hand-made theta


@pytest.fixture(scope="module")
def compiled() -> CompiledModel:
    return compiled_of("kapitza")


@pytest.fixture(scope="module")
def tables() -> WeakDesign:
    return design(0.3, 1000.0, STANDARD_PENDULUM.linear)


def column(part: Part, signals: dict[sp.Expr, Float], tables: WeakDesign) -> Float:
    """int chi sum D^m[psi] of every window [windows, K], terms of the highest order first as the hand-made columns."""
    one = np.ones_like(next(iter(signals.values())))

    def value(psi: sp.Expr) -> Float:
        out = one
        for factor in sp.Mul.make_args(psi):
            if isinstance(factor, Integral):
                assert factor.args[1] == 2
                out = out * weak.integrated_twice(value(factor.args[0]), tables.dt)
            elif factor.has(TIME):
                out = out * (tables.dt * np.arange(tables.window)) ** int(factor.as_base_exp()[1])
            elif factor != 1:
                out = out * signals[factor]
        return out

    total = None
    for m in sorted(part, reverse=True):
        for term in sp.Add.make_args(part[m]):
            number, rest = term.as_coeff_Mul()
            new = float(number) * (value(rest) @ tables.chi[:, m // 2])
            total = new if total is None else total + new
    assert total is not None
    return total


@pytest.fixture(scope="module")
def both(compiled: CompiledModel, tables: WeakDesign) -> tuple[Float, Float, Float]:
    """Columns Y, N1..N8 by the compiler and by hand [9, windows, K], and nuisances by the compiler."""
    run = simulate(seed=1).run
    phi, u = weak.front_end(run.phi, run.y, tables)
    signals = {Jet("phi"): weak.frames(phi, tables), Jet("u"): weak.frames(u, tables)}
    (row,) = compiled.rows
    parts = dict(zip(map(str, row.theta), row.regressors, strict=True))
    mine = [column(part, signals, tables) for part in (row.known, *(parts[name] for name in ORDER))]
    hand = np.moveaxis(weak.columns(signals[Jet("phi")], signals[Jet("u")], tables), 1, 0)
    t = tables.dt * np.arange(tables.window)
    free = [-(signals[Jet("u")] * (t if part[2].has(TIME) else 1.0)) @ tables.chi[:, 1] for part in row.nuisances]
    return np.array(mine), hand, np.array(free)


def test_theta_is_that_of_the_hand_made_rows(compiled: CompiledModel) -> None:
    (row,) = compiled.rows
    assert sorted(map(str, row.theta)) == sorted(ORDER)
    assert row.top == 4
    assert len(row.nuisances) == 2


def test_rows_equal_the_oracles_in_every_bit_but_where_the_integral_of_a_constant_is_exact(
    both: tuple[Float, Float, Float],
) -> None:
    mine, hand, _ = both
    for k in (0, 1, 2, 3, 4, 5, 6, 8):
        np.testing.assert_array_equal(mine[k], hand[k], err_msg=f"column {k}")
    # t^2/2 against a trapezoid of 1, whose terms linear in time the nuisance columns take
    np.testing.assert_allclose(mine[7], hand[7], atol=1e-4 * np.abs(hand[7]).max())


def test_nuisances_span_the_oracles(both: tuple[Float, Float, Float]) -> None:
    _, hand, free = both
    for window in range(hand.shape[1]):
        stacked = np.concatenate([hand[9:, window], free[:, window]])
        sizes = np.linalg.svd(stacked / np.linalg.norm(stacked, axis=1, keepdims=True), compute_uv=False)
        assert sizes[2] < 1e-12


def test_jacobian_equals_the_oracles(compiled: CompiledModel) -> None:
    (row,) = compiled.rows
    p = np.array([31.7, 8.9, 5.6, 0.01])
    by_name = {str(theta): theta for theta in row.theta}
    jacobian = sp.Matrix([by_name[name] for name in ORDER]).jacobian(list(compiled.p))
    mine = np.array(jacobian.subs(dict(zip(compiled.p, p, strict=True))), np.float64)
    np.testing.assert_allclose(mine, weak.jacobian(p), rtol=1e-14)
    assert np.count_nonzero(mine) == 16


def test_strong_form_is_the_papers() -> None:
    """theory.md 2: 11 theta, 18 non-zeros of the Jacobian, Y and every regressor."""
    model = Model("pendulum, encoder without offset")
    u, phi = model.input("u", "1/s^2", hold="sampled"), model.sensor("phi", "rad", resolution=1e-4)
    x = model.unmeasured("x", "rad")
    w, d1, d2 = model.unknown("w", "1/s^2", 30.0), model.unknown("d1", "", 9.0), model.unknown("d2", "", 6.0)
    model.equation(x.d(2) + (w + u) * x - (d1 - d2 - 1) * (w + u) * phi)
    model.equation(phi.d(2) - (w + u) * x + (d1 - 1) * (w + u) * phi)
    (row,) = strong_form(model.compiled()).rows
    y = u**2 * phi.d(4) - 2 * u * u.d() * phi.d(3) + (2 * u.d() ** 2 - u * u.d(2)) * phi.d(2)
    paper = {
        w: -2 * u * phi.d(4) + 2 * u.d() * phi.d(3) + u.d(2) * phi.d(2),
        w**2: -phi.d(4),
        d1: -(u**3) * phi.d(2),
        d1 * w: -3 * u**2 * phi.d(2),
        d1 * w**2: -3 * u * phi.d(2),
        d1 * w**3: -phi.d(2),
        d2: -(u**4) * phi,
        d2 * w: -4 * u**3 * phi,
        d2 * w**2: -6 * u**2 * phi,
        d2 * w**3: -4 * u * phi,
        d2 * w**4: -phi,
    }
    sign = 1 if sp.expand(row.known[0] - y) == 0 else -1
    assert sp.expand(row.known[0] - sign * y) == 0
    mine = {theta: sp.expand(sign * part[0]) for theta, part in zip(row.theta, row.regressors, strict=True)}
    assert mine == {theta: sp.expand(part) for theta, part in paper.items()}
    assert sum(1 for one in sp.Matrix(list(paper)).jacobian([w, d1, d2]) if one != 0) == 18


def test_strong_form_of_the_shipped_model_contains_the_zero(compiled: CompiledModel) -> None:
    (row,) = strong_form(compiled).rows
    assert len(row.theta) == 16
    assert row.top == 0
