"""Equations formed by sympy.physics.mechanics are those of the same mechanism written by hand."""

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import (
    KanesMethod,
    LagrangesMethod,
    Particle,
    PinJoint,
    Point,
    ReferenceFrame,
    RigidBody,
    System,
    Torque,
    dynamicsymbols,
    inertia,
)

from pvid.base.errors import PvidError
from pvid.model import Model, cos
from pvid.model.zero import is_zero

Q, QD, U, TAU = dynamicsymbols("q"), dynamicsymbols("q", 1), dynamicsymbols("u"), dynamicsymbols("tau")
M, LENGTH, G = sp.symbols("m l g")


def model_and_symbols() -> tuple[Model, dict[Any, Any]]:
    model = Model("pendulum")
    q, torque = model.sensor("q", "rad", resolution=1e-4), model.input("tau", "N*m", hold="zoh")
    known = {LENGTH: model.known("l", "m", 0.5), G: model.known("g", "m/s^2", 9.81)}
    return model, {Q: q, TAU: torque, M: model.unknown("m", "kg", 1.0), **known}


def by_hand() -> Model:
    model, of = model_and_symbols()
    q, tau = of[Q], of[TAU]
    energy = of[M] * of[LENGTH] ** 2 * q.d() ** 2 / 2 + of[M] * of[G] * of[LENGTH] * cos(q)
    model.lagrange(energy, [q], [tau])
    return model


def lagranges() -> LagrangesMethod:
    frame = ReferenceFrame("N")
    energy = M * LENGTH**2 * QD**2 / 2 + M * G * LENGTH * sp.cos(Q)
    turned = frame.orientnew("B", "Axis", [Q, frame.z])
    return LagrangesMethod(energy, [Q], forcelist=[(turned, TAU * frame.z)], frame=frame)


def kanes() -> KanesMethod:
    frame = ReferenceFrame("N")
    turned = frame.orientnew("B", "Axis", [Q, frame.z])
    turned.set_ang_vel(frame, U * frame.z)
    pivot = Point("O")
    pivot.set_vel(frame, 0)
    bob = pivot.locatenew("P", -LENGTH * turned.y)
    bob.v2pt_theory(pivot, frame, turned)
    method = KanesMethod(frame, q_ind=[Q], u_ind=[U], kd_eqs=[QD - U])
    loads = [(bob, -M * G * frame.y), (turned, TAU * frame.z)]
    method.kanes_equations([Particle("bob", bob, M)], loads)
    return method


def system() -> System:
    """A rigid body on a pin joint, of which the inertia about its own centre is 0."""
    base, frame, centre = RigidBody("base"), ReferenceFrame("B"), Point("C")
    rod = RigidBody("rod", masscenter=centre, frame=frame, mass=M, inertia=(inertia(frame, 0, 0, 0), centre))
    whole = System.from_newtonian(base)
    whole.add_joints(PinJoint("pin", base, rod, Q, U, child_point=LENGTH * frame.y, joint_axis=base.z))
    whole.apply_uniform_gravity(-G * base.y)
    whole.add_loads(Torque(frame, TAU * base.z))
    return whole


@pytest.mark.parametrize("form", [lagranges, kanes, system])
def test_the_rows_are_those_written_by_hand(form: Any) -> None:
    model, of = model_and_symbols()
    model.mechanics(form(), of)
    (mine,), (hand,) = model.compiled().rows, by_hand().compiled().rows
    assert mine.theta == hand.theta
    for one, other in zip((mine.known, *mine.regressors), (hand.known, *hand.regressors), strict=True):
        assert set(one) == set(other)
        assert all(is_zero(one[m] - other[m]) for m in one)


def test_what_has_no_signal_is_named_with_the_line() -> None:
    model, of = model_and_symbols()
    del of[TAU]
    with pytest.raises(PvidError, match=r"test_mechanics.py, line \d+: tau\(t\) has no signal"):
        model.mechanics(lagranges(), of)


def test_a_constant_without_counterpart_is_named() -> None:
    model, of = model_and_symbols()
    del of[M]
    with pytest.raises(PvidError, match="m is not declared"):
        model.mechanics(lagranges(), of)


def test_anything_else_is_refused() -> None:
    model, of = model_and_symbols()
    with pytest.raises(PvidError, match="int is none of LagrangesMethod"):
        model.mechanics(3, of)
