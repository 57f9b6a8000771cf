"""Possible bodies with the base parameters of a run: independent truth, files that are off."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import robot_arms
from robot_arms import Float

from pvid.identification.bodies import REACHED, bodies_of, inertial_of, pseudo_inertias
from pvid.identification.robot import answer_of_robot
from pvid.model import Robot
from pvid.model.chain import INERTIAL, Chain
from pvid.rig.run import Recording


def off_file(chain: Chain, seed: int, size: float = 0.15) -> Chain:
    """Bodies that are possible, and whose J is off by so much in any direction."""
    random, joints = np.random.default_rng(seed), []
    for joint in chain.joints:
        root = np.linalg.cholesky(pseudo_inertias(np.array([joint.inertial]))[0])
        root = root @ (np.eye(4) + size * random.normal(size=(4, 4)))
        j = root @ root.T
        joints.append(replace(joint, inertial=tuple(inertial_of(j))))
    return replace(chain, joints=tuple(joints))


def answered(chain: Chain, file: Chain, seed: int, **how: Any) -> Any:
    """A run of a chain, by a model with the bodies of a file."""
    robot = Robot("arm", file.gravity)
    robot.joints = list(file.joints)
    for k in range(1, len(file.joints) + 1):
        robot.sensor(f"q{k}", "rad", resolution=1e-4)
        robot.input(f"tau{k}", "N*m", hold="sampled")
    log = robot_arms.log_of(chain, seed, **how)
    return answer_of_robot(Recording(log.pop("t"), log, 500.0), robot.compiled())


def of_base(chain: Chain, inertial: Float) -> Float:
    """Base parameters of the bodies, with other inertias."""
    joints = tuple(replace(joint, inertial=tuple(one)) for joint, one in zip(chain.joints, inertial, strict=True))
    bodies = replace(chain, joints=joints)
    return np.array([bodies.of_file(one) for one in chain.base if chain.standard[one.standard].kind in INERTIAL])


@pytest.mark.parametrize(("how", "binds"), [({}, 0), ({"seconds": 6.0, "noise": 0.3}, 2)])
def test_they_have_the_values_where_they_can_and_are_nearer_to_the_truth_where_not(how: Any, binds: int) -> None:
    found = 0
    for seed in range(6):
        chain = robot_arms.arm("spatial", seed)
        truth = np.array([one.inertial for one in chain.joints])
        answer = answered(chain, off_file(chain, seed), seed + 50, **how)
        bodies = answer.bodies
        assert np.linalg.eigvalsh(pseudo_inertias(bodies.inertial)).min() > 0
        own = [*bodies.base]
        weights = np.linalg.inv(answer.fit.covariance[np.ix_(own, own)])
        left = of_base(chain, bodies.inertial) - of_base(chain, truth)
        free = answer.fit.p[own] - of_base(chain, truth)
        told = [one for one in answer.lines if one.startswith("no possible bodies")]
        assert bool(told) == bodies.impossible == bool(np.max(np.abs(bodies.off)) > REACHED)
        if told:
            found += 1
            assert left @ weights @ left < free @ weights @ free
    assert (found == 0) if binds == 0 else (found >= binds)  # of 6; 4 of 8 in such runs


def test_nothing_is_said_of_bodies_that_are_far_from_the_file() -> None:
    """Of placeholders: 1 g, 10 g, and a pseudo-inertia off by a half."""
    for seed in range(3):
        chain = robot_arms.arm("spatial", seed)
        p, none = np.array([chain.of_file(one) or 0.0 for one in chain.base]), np.zeros(len(chain.base), np.bool_)
        covariance = np.diag((1e-3 * np.abs(p) + 1e-4) ** 2)
        for mass in (0.001, 0.01):
            one = replace(chain.joints[-1], inertial=(mass, 0, 0, 0, *(1e-3 * mass * np.array([1, 0, 0, 1, 0, 1]))))
            found = bodies_of(replace(chain, joints=(*chain.joints[:-1], one)), p, covariance, none)
            assert found is None or not found.impossible
        found = bodies_of(off_file(chain, seed, 0.5), p, covariance, none)
        assert found is not None and not found.impossible and np.abs(found.off).max() < REACHED


def test_a_rotor_is_that_of_the_file() -> None:
    chain = robot_arms.arm("spatial", 1)
    chain = replace(chain, joints=tuple(replace(one, rotor=0.05) for one in chain.joints))
    p = np.array([chain.of_file(one) or 0.0 for one in chain.base])
    found = bodies_of(chain, p, np.diag(np.full(len(p), 1e-6)), np.zeros(len(p), np.bool_))
    assert found is not None
    truth = np.array([one.inertial for one in chain.joints], np.float64)
    np.testing.assert_allclose(found.inertial, truth, atol=1e-9)


def test_a_file_that_is_right_stays() -> None:
    chain = robot_arms.arm("panda", 2)
    truth = np.array([one.inertial for one in chain.joints])
    p = np.array([chain.of_file(one) or 0.0 for one in chain.base])
    bodies = bodies_of(chain, p, np.diag(np.full(len(p), 1e-6)), np.zeros(len(p), np.bool_))
    assert bodies is not None and np.abs(bodies.inertial - truth).max() < 1e-9


def test_without_inertias_or_with_impossible_ones_there_are_none() -> None:
    chain = robot_arms.arm("spatial", 0)
    p, none = np.ones(len(chain.base)), np.zeros(len(chain.base), np.bool_)
    for inertial in (None, (1.0, 0, 0, 0, 1.0, 0, 0, 0.1, 0, 0.1)):
        joints = (*chain.joints[:-1], replace(chain.joints[-1], inertial=inertial))
        assert bodies_of(replace(chain, joints=joints), p, np.eye(len(p)), none) is None
    assert bodies_of(chain, p, np.eye(len(p)), ~none) is None
    massless = replace(chain, joints=tuple(replace(one, inertial=(0.0,) * 10) for one in chain.joints))
    assert bodies_of(massless, p, np.eye(len(p)), none) is None
