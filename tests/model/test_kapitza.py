"""The compiled pendulum has the theta of the paper's constraints, and the paper's strong form."""

import numpy as np
import pytest
import sympy as sp

from pvid.model.compiled import CompiledModel
from pvid.model.strong import strong_form
from pvid.models.kapitza.paper_pendulum import d1, d2, model, phi, u, w
from pvid.models.mechanisms import compiled_of

ORDER = ("d1", "d1*w", "d2", "d2*w", "d2*w**2", "c*d2", "c*d2*w", "c*d2*w**2")


@pytest.fixture(scope="module")
def compiled() -> CompiledModel:
    return compiled_of("kapitza")


def test_theta_is_that_of_the_constraints(compiled: CompiledModel) -> None:
    (row,) = compiled.rows
    assert sorted(map(str, row.theta)) == sorted(ORDER)
    assert row.top == 4
    assert len(row.nuisances) == 2


def test_jacobian_has_sixteen_entries(compiled: CompiledModel) -> None:
    (row,) = compiled.rows
    p = np.array([31.7, 8.9, 5.6, 0.01])
    by_name = {str(theta): theta for theta in row.theta}
    jacobian = sp.Matrix([by_name[name] for name in ORDER]).jacobian(list(compiled.p))
    mine = np.array(jacobian.subs(dict(zip(compiled.p, p, strict=True))), np.float64)
    assert np.count_nonzero(mine) == 16


def test_strong_form_is_the_papers() -> None:
    """theory.md 2: 11 theta, 18 non-zeros of the Jacobian, Y and every regressor."""
    (row,) = strong_form(model.compiled("paper_pendulum")).rows
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
