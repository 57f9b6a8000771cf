"""A robot on a fixed or a free base: joints with encoders, each driven by a torque that is recorded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import sympy as sp

from pvid.model.chain import INERTIAL, POSE, POSE_AXES, SLIDING, WRENCH, Base, Chain, Joint, rotation_of
from pvid.model.compiled import CompiledModel, Unknown
from pvid.model.description import Model

MOST_JOINTS = 12
_ENCODER, _SCALE = 2 * math.pi / 2**16, 1e-5  # resolutions unless given [rad], [m]
_UNIT = 1e-6  # of the length of an axis


class Robot(Model):
    """A mechanism of rigid bodies in a tree of joints; `compiled` has its base parameters as unknowns.

    The signals are q1, tau1, q2, tau2, .. in the order of the joints; a joint with a torque constant has a current i1
    in place of tau1. A free base has x, y, z, yaw, pitch and roll before them. `file` is the URDF or MJCF file that it
    is from, by the path from its model file: identified values can be written to a copy of it.
    """

    def __init__(self, title: str, gravity: Sequence[float] = (0.0, 0.0, -9.81), file: str | None = None) -> None:
        super().__init__(title)
        if file is not None and not isinstance(file, str):
            raise self._refused(f"file: the path of a URDF or MJCF file is needed, not {file}")
        self.file = file
        self.joints: list[Joint] = []
        self.gravity = self._three("gravity", gravity)
        self.space: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None

    def box(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Lowest and highest corner of the space that the points of a designed motion do not leave [m]."""
        self.space = self._three("box: low", low), self._three("box: high", high)
        if not all(one < other for one, other in zip(*self.space, strict=True)):
            raise self._refused(f"box: {tuple(low)} is not below {tuple(high)}")

    def free_base(
        self,
        name: str,
        inertial: Sequence[float] | None = None,
        wrench: bool = False,
        hold: Literal["zoh", "sampled"] = "sampled",
        resolution: tuple[float, float] = (1e-3, 1e-3),
    ) -> None:
        """A body that is fixed to nothing, before all joints: a drone, a satellite, a robot that floats.

        Its signals are the place x, y, z [m] of its frame in the inertial one, and yaw, pitch and roll [rad]: it is
        turned by yaw about z, then by pitch about y, then by roll about x.

        Parameters
        ----------
        inertial : as of `joint`; the parameters of this body have the number 0
        wrench : the force fx, fy, fz [N] and the moment about the frame's origin mx, my, mz [N*m] that act on the body
            from outside (thrust), in the body's frame, are recorded; without it nothing but gravity acts
        hold : "zoh" for a wrench that is commanded and held from sample to sample
        resolution : of place and angles [m], [rad]
        """
        if self.joints:
            raise self._refused(f"{name}: a free base comes before all joints, and once")
        given = self._inertial(name, inertial)
        for k, (pose, axis) in enumerate(zip(POSE, POSE_AXES, strict=True)):
            slides = k < SLIDING
            self.sensor(pose, "m" if slides else "rad", resolution=resolution[not slides], reach=math.pi, gain_sd=0.0)
            self.joints.append(
                Joint(
                    name if k == len(POSE) - 1 else f"{name}_{pose}",
                    k - 1,
                    axis,
                    (0.0, 0.0, 0.0),
                    rotation_of((0.0, 0.0, 0.0)),
                    prismatic=slides,
                    inertial=given if k == len(POSE) - 1 else (0.0,) * len(INERTIAL),
                    free=True,
                )
            )
        for k, one in enumerate(WRENCH if wrench else ()):
            self.input(one, "N" if k < SLIDING else "N*m", hold=hold, reach=100.0)

    def joint(
        self,
        name: str,
        axis: Sequence[float],
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        rpy: Sequence[float] = (0.0, 0.0, 0.0),
        parent: str | None = None,
        prismatic: bool = False,
        inertial: Sequence[float] | None = None,
        rotor: float | None = None,
        offset: bool = False,
        torque_constant: float | None = None,
        resolution: float | None = None,
        hold: Literal["zoh", "sampled"] = "sampled",
        friction: Sequence[float] | None = None,
        limits: Sequence[float] | None = None,
        speed: float | None = None,
        torque: float | None = None,
        noise: float | None = None,
        points: Sequence[Sequence[float]] = (),
    ) -> None:
        """A joint and the body that it moves; the frame of the body has its origin on the axis.

        Parameters
        ----------
        axis : in the body's frame
        origin, rpy : of the body's frame at q = 0 in that of its parent, as in URDF [m], [rad]
        parent : joint that carries this one, or "base"; the one before by default
        prismatic : it slides along the axis
        inertial : m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of the file [kg, kg*m, kg*m^2]: h is m times the centre,
            I about the frame's origin; they are what the answer is compared with
        rotor : inertia of the motor's rotor at the joint, gear included [kg*m^2]; None: it has none
        offset : the recorded torque has a constant offset, which is identified
        torque_constant : torque at the joint per ampere [N*m/A]: a current i1 is recorded
        resolution : of the encoder [rad, m]
        hold : "zoh" for a torque that is commanded and held from sample to sample
        friction : viscous and dry, as the file has them [N*m*s], [N*m]
        limits, speed, torque : of a motion that is designed: lowest and highest position [rad], largest speed [rad/s]
            and torque [N*m]; of a joint that slides in m and N
        noise : of the recorded torque [N*m]; a hundredth of `torque` by default
        points : of the body, in its frame, that stay in the box [m]; its centre of mass by default
        """
        free = sum(one.free for one in self.joints)
        number = len(self.joints) + 1 - free
        if number > MOST_JOINTS:
            raise self._refused(f"a robot has at most {MOST_JOINTS} joints")
        names = [one.name for one in self.joints]
        if name in names:
            raise self._refused(f"the joint {name} is there twice")
        carriers = names[max(free - 1, 0) :] if free else ["base", *names]
        if parent not in (None, *carriers):
            raise self._refused(f"{name}: its parent {parent} is none of {', '.join(carriers)}")
        along = np.array(self._three(f"{name}: axis", axis))
        size = float(np.linalg.norm(along))
        if abs(size - 1) > _UNIT:
            raise self._refused(f"{name}: the axis {tuple(axis)} must have the length 1, not {size:g}")
        given = self._inertial(name, inertial)
        speed, torque, noise = (
            self._positive(f"{name}: {what}", value)
            for what, value in (("speed", speed), ("torque", torque), ("noise", noise))
        )
        reach, rubbed = self._two(f"{name}: limits", limits), self._two(f"{name}: friction", friction)
        if reach is not None and reach[0] >= reach[1]:
            raise self._refused(f"{name}: limits are the lowest and the highest position, not {limits}")
        if rubbed is not None and min(rubbed) < 0:
            raise self._refused(f"{name}: friction is not negative, as {friction} is")
        if resolution is None:
            resolution = _SCALE if prismatic else _ENCODER
        self.sensor(f"q{number}", "m" if prismatic else "rad", resolution=resolution, reach=math.pi, gain_sd=0.0)
        if torque_constant is None:
            self.input(f"tau{number}", "N" if prismatic else "N*m", hold=hold, reach=100.0)
        else:
            self.input(f"i{number}", "A", hold=hold, reach=100.0)
            self.known(f"kt{number}", "N/A" if prismatic else "N*m/A", torque_constant)
        self.joints.append(
            Joint(
                name,
                len(self.joints) - 1 if parent is None else -1 if parent == "base" else names.index(parent),
                (along[0] / size, along[1] / size, along[2] / size),
                self._three(f"{name}: origin", origin),
                rotation_of(self._three(f"{name}: rpy", rpy)),
                prismatic,
                given,
                None if rotor is None else float(rotor),
                offset,
                rubbed,
                reach,
                speed,
                torque,
                noise,
                points=tuple(self._three(f"{name}: a point", one) for one in points),
            )
        )

    def compiled(self, name: str = "") -> CompiledModel:
        """Its base parameters and signals; rows are computed by recursion (pvid.model.chain)."""
        if all(one.free for one in self.joints):
            what = "the free base has neither a joint nor a wrench" if self.joints else "the robot has no joint"
            if not any(one.kind == "input" for one in self.signals):
                raise self._refused(f"{self.title}: {what}")
        chain = Chain(tuple(self.joints), self.gravity, self.space)
        return CompiledModel(
            name or "robot",
            self.title,
            tuple(self.signals),
            tuple(_unknown(chain, one) for one in chain.base),
            tuple(self.knowns),
            (),
            (),
            clock_sd=0.0,
            chain=chain,
        )

    def _inertial(self, name: str, given: Sequence[float] | None) -> tuple[float, ...] | None:
        if given is None:
            return None
        out = _finite(given, len(INERTIAL))
        if out is None:
            raise self._refused(f"{name}: inertial has {len(INERTIAL)} numbers: {', '.join(INERTIAL)}")
        return out

    def _two(self, what: str, given: Sequence[float] | None) -> tuple[float, float] | None:
        if given is None:
            return None
        out = _finite(given, 2)
        if out is None:
            raise self._refused(f"{what}: two finite numbers are needed, not {given}")
        return out[0], out[1]

    def _positive(self, what: str, given: float | None) -> float | None:
        if given is None:
            return None
        try:
            value = float(given)
        except (TypeError, ValueError):
            value = math.nan
        if not 0 < value < math.inf:
            raise self._refused(f"{what} must be a number above 0, not {given}")
        return value

    def _three(self, what: str, given: Sequence[float]) -> tuple[float, float, float]:
        out = _finite(given, 3)
        if out is None:
            raise self._refused(f"{what} has three numbers, not {given}")
        return out[0], out[1], out[2]


def _finite(given: Sequence[float], count: int) -> tuple[float, ...] | None:
    """So many finite numbers; None: it is something else."""
    try:
        out = tuple(float(one) for one in given)
    except (TypeError, ValueError):
        return None
    return out if len(out) == count and np.isfinite(out).all() else None


def _unknown(chain: Chain, base: Base) -> Unknown:
    """Any value is possible: the guess is that of the file."""
    name, unit = chain.name_of(base), chain.standard[base.standard].unit
    guess = chain.of_file(base) or 0.0
    return Unknown(sp.Symbol(name, real=True), unit, guess, False, -math.inf, math.inf, abs(guess) or 1.0)
