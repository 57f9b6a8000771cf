"""Motions of robots within limits: random limits that none may break, and errors beside those of simple drives.

MuJoCo is the judge: torques by its inverse dynamics, places of the points by its kinematics, at four times the steps of
the grid on which the design checks itself.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, columns
from pvid.base.errors import PvidError
from pvid.configuration.robot_motion import Series, designed_motion, simple_drives
from pvid.identification.bodies import about_centre, pseudo_inertias
from pvid.model import Robot
from pvid.model.chain import Chain, Joint, rotation_of
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.robot import identify_robot

Float = npt.NDArray[np.float64]
HERTZ, STEP = 2000.0, 2 * math.pi / 2**16  # of the check; of the encoders
VISCOUS, DRY = 0.5, 1.0
DRAWS = columns("draws | refused: no pose or motion keeps them | motions | beyond a limit | closest of a kind")
ERRORS = columns(
    "joints | parameters | multisine s | designed s | CPU s of the design | errors of the multisine / designed,"
    " geometric mean | worst parameter | standard errors likewise | within 2 s.e. %"
)


def arm(joints: int, random: np.random.Generator) -> list[Joint]:
    """A chain with joints in every direction, and bodies that are possible."""
    out = []
    for k in range(joints):
        mass, centre = 5.0 / (k + 1), random.uniform(-0.1, 0.1, 3) + [0.1, 0, 0.05]
        spread = random.normal(size=(3, 3)) * 0.08
        second = mass * (spread @ spread.T + np.outer(centre, centre))
        about = np.trace(second) * np.eye(3) - second
        out.append(
            Joint(
                f"j{k}", k - 1, (0.0, 0.0, 1.0), (0.0 if k < 2 else 0.35, 0.0, 0.0 if k else 0.3),
                rotation_of((0 if k == 0 else (-1) ** k * math.pi / 2 * (k % 3 > 0), 0, 0)),
                inertial=(mass, *(mass * centre), *about[np.triu_indices(3)]), friction=(VISCOUS, DRY),
            )
        )  # fmt: skip
    return out


def compiled(joints: list[Joint], box: Any) -> CompiledModel:
    """A robot of these joints."""
    robot = Robot("arm")
    robot.joints, robot.space = joints, box
    for k in range(1, len(joints) + 1):
        robot.sensor(f"q{k}", "rad", resolution=STEP)
        robot.input(f"tau{k}", "N*m", hold="sampled")
    return robot.compiled()


class Judge:
    """MuJoCo's model of a chain."""

    def __init__(self, chain: Chain) -> None:
        import mujoco

        spec = mujoco.MjSpec()
        spec.option.gravity = chain.gravity
        bodies: list[Any] = []
        for joint in chain.joints:
            above = bodies[joint.parent] if joint.parent >= 0 else spec.worldbody
            quaternion, turned = np.zeros(4), np.array(joint.turned)
            mujoco.mju_mat2Quat(quaternion, turned.reshape(-1))
            mass, centre, about = about_centre(pseudo_inertias(np.array([joint.inertial]))[0])
            body = above.add_body(pos=joint.origin, quat=quaternion, mass=mass, ipos=centre, explicitinertial=True,
                                  fullinertia=about[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)])  # fmt: skip
            body.add_joint(axis=joint.axis)
            body.add_site(pos=centre)
            bodies.append(body)
        self.mujoco, self.model = mujoco, spec.compile()
        self.data = mujoco.MjData(self.model)

    def torques(self, q: Float, v: Float, a: Float) -> tuple[Float, Float]:
        """Torques without friction [n, times], and lowest and highest places of origins and centres [2, points, 3]."""
        found, places = np.zeros(q.shape), []
        for k in range(q.shape[1]):
            self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q[:, k], v[:, k], a[:, k]
            self.mujoco.mj_inverse(self.model, self.data)
            found[:, k] = self.data.qfrc_inverse
            places.append(np.concatenate([self.data.site_xpos, self.data.xpos[2:]]))
        return found, np.array([np.min(places, axis=0), np.max(places, axis=0)])


def beyond(model: CompiledModel, series: Series) -> dict[str, float]:
    """Largest part of a limit that MuJoCo finds; of the box 1 and what is outside in metres."""
    chain = model.chain
    assert chain is not None
    _, (q, v, a) = series.samples(HERTZ)
    torque, places = Judge(chain).torques(q, v, a)
    torque += VISCOUS * v + DRY * np.sign(v)
    out = {"position": 0.0, "speed": 0.0, "torque": 0.0}
    for k, joint in enumerate(chain.joints):
        assert joint.limits and joint.speed and joint.torque
        middle, half = sum(joint.limits) / 2, (joint.limits[1] - joint.limits[0]) / 2
        sizes = (
            np.abs(q[k] - middle).max() / half,
            np.abs(v[k]).max() / joint.speed,
            np.abs(torque[k]).max() / joint.torque,
        )
        out = {name: max(one, float(size)) for (name, one), size in zip(out.items(), sizes, strict=True)}
    if chain.box is not None:
        out["box"] = 1 + float(max(np.max(chain.box[0] - places[0]), np.max(places[1] - chain.box[1])))
    return out


def drawn(seed: int) -> tuple[CompiledModel, float]:
    """An arm of two or three joints with limits at random, and the length of a motion [s]."""
    random = np.random.default_rng(seed)
    joints = []
    for one in arm(int(random.integers(2, 4)), random):
        middle, half = random.uniform(-2, 2), 10 ** random.uniform(-1, 0.5)
        joints.append(
            replace(one, limits=(middle - half, middle + half), speed=float(10 ** random.uniform(-0.7, 1)),
                    torque=float(10 ** random.uniform(0.7, 2.3)))
        )  # fmt: skip
    low = np.array([*-(10 ** random.uniform(-0.5, 0.3, 2)), random.uniform(-0.5, 0.2)])
    box = (tuple(low), tuple(low + 10 ** random.uniform(0, 0.5, 3))) if random.integers(4) else None
    return compiled(joints, box), float(random.uniform(2.5, 4))


def verdict(seed: int, turns: int) -> dict[str, float] | None:
    """Of a motion for limits at random; None: refused."""
    model, duration = drawn(seed)
    random = np.random.default_rng(seed)
    try:
        drives = simple_drives(model, duration, 500.0)
    except PvidError:
        return None
    task, series = drives[random.integers(len(drives))]
    return beyond(model, task.improved(series, turns) if turns else series)


def errors(joints: int, seeds: int, long: float, short: float) -> list[str]:
    """Of a designed motion beside the best multisine of a longer time, in a row."""
    import time

    random = np.random.default_rng(joints)
    limits = [replace(one, limits=(-2.0, 2.0), speed=2.0, torque=60.0 / (k + 1) ** 0.5)
              for k, one in enumerate(arm(joints, random))]  # fmt: skip
    model = compiled(limits, ((-1.5, -1.5, -0.5), (1.5, 1.5, 2.0)))
    chain = model.chain
    assert chain is not None
    truth = np.array([chain.of_file(one) for one in chain.base], np.float64)
    began = time.process_time()
    motion = designed_motion(model, short, 500.0)
    cpu = time.process_time() - began
    judge = Judge(chain)

    def studied(series: Series) -> tuple[Float, Float, Float]:
        """Root mean square errors, standard errors, and errors in standard errors."""
        _, (q, v, a) = series.samples(500.0)
        torque = judge.torques(q, v, a)[0] + VISCOUS * v + DRY * np.sign(v)
        off, sizes = [], []
        for seed in range(seeds):
            noise = np.random.default_rng(seed)
            read = np.round(q / STEP + 0.3 * noise.normal(size=q.shape)) * STEP
            felt = torque + motion.noise[:, np.newaxis] * noise.normal(size=q.shape)
            run = {f"q{k + 1}": one for k, one in enumerate(read)} | {f"tau{k + 1}": one for k, one in enumerate(felt)}
            fit = identify_robot(model, run, 500.0)
            off.append(fit.p - truth)
            sizes.append(np.sqrt(np.diag(fit.covariance)))
        return np.sqrt(np.mean(np.square(off), axis=0)), np.mean(sizes, axis=0), np.array(off) / np.array(sizes)

    own = studied(motion.series)
    others = [studied(one) for _, one in simple_drives(model, long, 500.0)]
    best = min(others, key=lambda one: float(np.sum(np.log(one[1]))))
    ratio, sizes = best[0] / own[0], best[1] / own[1]
    mean = [f"{math.exp(float(np.mean(np.log(one)))):.2f}" for one in (ratio, sizes)]
    inside = 100 * float(np.mean(np.abs(own[2]) < 2))
    return [str(joints), str(len(truth)), f"{long:g}", f"{short:g}", f"{cpu:.0f}", mean[0], f"{ratio.min():.2f}",
            mean[1], f"{inside:.1f}"]  # fmt: skip


def report(draws: int, turns: int, seeds: int, joints: tuple[int, ...], advance: Advance) -> Report:
    """Both tables."""
    found: list[dict[str, float] | None] = []
    for seed in range(draws):
        found.append(verdict(seed, turns))
        advance()
    kept = [one for one in found if one is not None]
    worst: Counter[str] = Counter()
    for one in kept:
        worst |= Counter(one)
    broken = sum(max(one.values()) > 1.0 for one in kept)
    close = ", ".join(f"{name} {size:.4f}" for name, size in worst.items())
    row = [str(draws), str(draws - len(kept)), str(len(kept)), str(broken), close]
    rows = []
    for size in joints:
        rows.append(errors(size, seeds, 30.0, 10.0))
        advance()
    faults = [f"{broken} motions are beyond a limit"] if broken else []
    return Report((("robot-limits", DRAWS, [row]), ("robot-motion", ERRORS, rows)), faults)
