"""The strong form of the shipped mechanisms is their weak rows with every derivative carried out."""

import pytest
import sympy as sp

from bench.kinds import KINDS
from pvid.model.compiled import Row
from pvid.model.signals import Jet, jets, sgn, total_derivative
from pvid.model.strong import strong_form
from pvid.model.zero import is_zero
from pvid.models.mechanisms import compiled_of


def residual(row: Row, marks: dict[sp.Expr, Jet]) -> sp.Expr:
    """sum theta N - Y in jets, where signals of their own stand for sgn(..)."""
    total = sp.Integer(0)
    for theta, part in [*zip(row.theta, row.regressors, strict=True), (sp.Integer(-1), row.known)]:
        total += theta * sum(total_derivative(psi.xreplace(marks), m) for m, psi in part.items())
    return sp.expand(total)


@pytest.mark.parametrize("name", sorted({*KINDS} - {"kapitza"}))
def test_strong_rows_are_the_weak_ones_differentiated(name: str) -> None:
    weak = compiled_of(name)
    strong = strong_form(weak)
    marks = {value: jet for jet, value in strong.opaque.items() if isinstance(value, sgn)}
    for one, other in zip(weak.rows, strong.rows, strict=True):
        assert {m for part in (*other.regressors, other.known) for m in part} == {0}
        mine, theirs = residual(one, marks), residual(other, marks)
        assert is_zero(mine - theirs) or is_zero(mine + theirs)


def test_the_sign_of_a_speed_is_a_signal_where_it_would_be_differentiated() -> None:
    strong = strong_form(compiled_of("two_mass_drive"))
    (auxiliary,) = strong.opaque
    assert strong.opaque[auxiliary] == sgn(Jet("th", 1))
    used = {jet for part in strong.rows[0].regressors for psi in part.values() for jet in jets(psi)}
    assert {auxiliary.d(), auxiliary.d(2)} <= used
    assert auxiliary not in used
