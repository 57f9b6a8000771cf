"""Robots: the momenta's rows against Newton and Euler, base parameters, and what a description refuses."""

import math
import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import robot_arms

from pvid.base.errors import PvidError
from pvid.model import Robot
from pvid.model.chain import Chain, friction
from pvid.model.operations import evaluated
from pvid.models.mechanisms import compiled_of


def by_rows(chain: Chain, columns: list[int], values: list[float], q: Any, v: Any, a: Any) -> Any:
    """Torques [n, states]: d/dt p - g, the derivative along the motion by a complex step."""
    program, entries = chain.program(columns)
    step = 1e-30
    along = evaluated(program, [*(q + 1j * step * v), *(v + 1j * step * a)])
    out = np.zeros(q.shape)
    for (order, joint, place), one in zip(entries, along, strict=True):
        one = np.broadcast_to(one, q.shape[1:])
        out[joint] += values[place] * (one.imag / step if order else one.real)
    return out


CHAINS = {
    **{name: robot_arms.arm(name) for name in robot_arms.DH},
    **{f"tree of {n}": robot_arms.tree(n, n) for n in (1, 2, 5, 12)},
}


@pytest.mark.parametrize("name", CHAINS)
def test_rows_give_the_torques_of_newton_and_euler(name: str) -> None:
    chain = CHAINS[name]
    q, v, a = np.random.default_rng(1).uniform(-2, 2, (3, len(chain.joints), 20))
    exact = robot_arms.torques(chain, q, v, a)
    base = [one for one in chain.base if chain.standard[one.standard].kind not in ("Fv", "Fc", "Offset")]
    values = [chain.of_file(one) or 0.0 for one in base]
    found = by_rows(chain, [one.standard for one in base], values, q, v, a)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-9 * np.abs(exact).max())  # rounding: 1e-13 of it


# W. Khalil, E. Dombre: Modeling, Identification and Control of Robots, 2002; C. Gaz et al., IEEE RA-L 4 (2019) 4147.
@pytest.mark.parametrize(("name", "known"), [("spatial", 15), ("puma", 36), ("panda", 43)])
def test_there_are_as_many_base_parameters_as_are_known(name: str, known: int) -> None:
    chain = CHAINS[name]
    assert chain.inertial == known
    assert len(chain.base) == known + 2 * len(chain.joints)


def test_base_parameters_are_named_in_closed_form() -> None:
    chain = CHAINS["spatial"]
    forms = {chain.name_of(one): chain.closed_form(one) for one in chain.base}
    assert forms["Izz1_R"] == "Izz1 + Iyy2 + Iyy3 + 0.16*m3"
    assert forms["hx2_R"] == "hx2 + 0.4*m3" and forms["hy2"] == "hy2"
    assert forms["Ixx3_R"] == "Ixx3 - Iyy3" and forms["Fc3"] == "Fc3"


def test_seven_joints_in_space_are_compiled_within_ten_seconds() -> None:
    began = time.process_time()
    chain = robot_arms.arm("panda", seed=3)
    program, entries = chain.program([one.standard for one in chain.base])
    assert len(entries) > 300 and len(list(friction(chain, range(len(chain.standard))))) == 14
    assert time.process_time() - began < 10.0  # 0.05 s
    assert program.operations < 2500  # of its base columns: 1 964; of all columns 3 263


def _robot() -> Robot:
    robot = Robot("one joint")
    robot.joint("j", (0, 0, 1), rpy=(math.pi / 2, 0, 0), torque_constant=0.5, offset=True)
    robot.joint("slide", (1, 0, 0), prismatic=True, rotor=0.0)
    return robot


def test_signals_follow_from_the_joints() -> None:
    model = compiled_of(_robot())
    assert [(one.name, one.unit) for one in model.signals] == [("q1", "rad"), ("i1", "A"), ("q2", "m"), ("tau2", "N")]
    assert [(one.name, one.value) for one in model.knowns] == [("kt1", 0.5)]
    assert {"Offset1", "Fc2"} < set(model.p_names)
    assert "Ia2" in model.p_names  # the weight shows the mass without it


def _joints(robot: Robot, *names: str) -> None:
    for one in names:
        robot.joint(one, (0, 0, 1))


REFUSED: dict[str, tuple[Callable[[Robot], Any], str]] = {
    "axis": (lambda r: r.joint("a", (0, 0, 2)), "a: the axis (0, 0, 2) must have the length 1, not 2"),
    "numbers": (lambda r: r.joint("a", (0, 1)), "a: axis has three numbers, not (0, 1)"),
    "twice": (lambda r: _joints(r, "a", "a"), "the joint a is there twice"),
    "parent": (lambda r: r.joint("a", (0, 0, 1), parent="b"), "a: its parent b is none of base"),
    "inertial": (lambda r: r.joint("a", (0, 0, 1), inertial=(1, 2)), "a: inertial has 10 numbers: m, hx"),
    "many": (lambda r: _joints(r, *map(str, range(13))), "a robot has at most 12 joints"),
    "none": (lambda r: r.compiled(), "arm: the robot has no joint"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_robot_is_refused(name: str) -> None:
    make, sentence = REFUSED[name]
    with pytest.raises(PvidError, match=re.escape(sentence)):
        make(Robot("arm"))
