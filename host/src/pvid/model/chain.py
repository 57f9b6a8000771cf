"""Robots of rigid bodies: momenta by recursion, and the parameters that torques depend on.

    tau_i = d/dt p_i - g_i + friction,   p_i = dT/dq_i',   g_i = d(T - V)/dq_i

p_i and g_i are linear in the ten inertial parameters of each body and contain no acceleration. Outwards the recursion
gives w, v and gravity in each body's frame, inwards the momenta K = I w + h x v and L = m v + w x h of a parameter, and
the moment and the force of gravity on it. With a the axis, a revolute joint has p = a K, g = a (K x w + L x v) + a M, a
prismatic one p = a L, g = a (L x w) + a F (W. Khalil, E. Dombre: Modeling, Identification and Control of Robots, 2002,
chapters 9 and 12).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.model.operations import Program, Traced, evaluated, traced

Float = npt.NDArray[np.float64]
Number = Traced | float
Vector = Sequence[Number]
INERTIAL = ("m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_PRODUCTS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_OF_FILE = ("Fv", "Fc")
_SNAPPED = 1e-12  # what is as close to 0 or 1 is that
_DEPENDENT = 1e-9  # part of a column that is left when the columns before it explain it
_STATES = 60  # random ones, whose rows decide what depends on what
# Of a free base: where its body's frame is in the inertial one (turned by yaw about z, then pitch about y, then roll
# about x), and the force and the moment about its origin that act on the body from outside, in its frame.
POSE, WRENCH = ("x", "y", "z", "yaw", "pitch", "roll"), ("fx", "fy", "fz", "mx", "my", "mz")
POSE_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
SLIDING = 3  # of both, the first ones: along the axes; the others about them


@dataclass(frozen=True)
class Joint:
    """A joint and the body that it moves; the frame of the body has its origin on the axis.

    Attributes
    ----------
    name : as in the robot's file
    parent : place of the joint that carries it; -1: the base
    axis : unit vector, in the body's frame
    origin : of the body's frame at q = 0, in the parent's [m]
    turned : rotation from the body's frame at q = 0 to the parent's [3, 3]
    prismatic : it slides
    inertial : INERTIAL as the file has them: m [kg], h = m times the centre [kg*m], I about the frame's origin
        [kg*m^2]; None: not known
    rotor : inertia of the motor's rotor at the joint, as the file has it [kg*m^2, kg]; None: there is none
    offset : the torque has a constant offset
    friction : viscous and dry, as the file has them [N*m*s, N*m; N*s/m, N]; None: not known
    limits : lowest and highest position [rad, m]
    speed, torque : their largest sizes [rad/s, m/s], [N*m, N]; None: no limit
    noise : of the recorded torque [N*m, N]; None: not known
    points : of the body, in its frame, that stay in the box [m]
    free : it is one of POSE, without a drive, friction, or (but the last) a body
    """

    name: str
    parent: int
    axis: tuple[float, float, float]
    origin: tuple[float, float, float]
    turned: tuple[tuple[float, ...], ...]
    prismatic: bool = False
    inertial: tuple[float, ...] | None = None
    rotor: float | None = None
    offset: bool = False
    friction: tuple[float, float] | None = None
    limits: tuple[float, float] | None = None
    speed: float | None = None
    torque: float | None = None
    noise: float | None = None
    points: tuple[tuple[float, float, float], ...] = ()
    free: bool = False


@dataclass(frozen=True)
class Standard:
    """A parameter of a joint or body, as the file has it: place of the joint, name as in Ixx2, kind as in Ixx, unit."""

    joint: int
    name: str
    kind: str
    unit: str


@dataclass(frozen=True)
class Base:
    """A combination of standard parameters that the torques depend on.

    Attributes
    ----------
    standard : place of the first of them, whose column is that of all
    parts : (place, factor) of all, the first with 1
    """

    standard: int
    parts: tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class Chain:
    """A robot: joints from the base outwards, those of a free base first; gravity [m/s^2], and the lowest and highest
    corner of the box that its points must not leave, in the base's frame [m]; None: no box."""

    joints: tuple[Joint, ...]
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None

    @cached_property
    def free(self) -> int:
        """How many joints are of a free base: 6 or 0."""
        return sum(one.free for one in self.joints)

    @property
    def extent(self) -> str:
        """As in "3 joints on a free base"."""
        n = len(self.joints) - self.free
        return f"{n} joint{'' if n == 1 else 's'}{' on a free base' if self.free else ''}"

    def number(self, joint: int) -> int:
        """Of a joint, from 1; the body of a free base has 0."""
        return joint + 1 - self.free

    def position(self, joint: int) -> str:
        """Name of its signal."""
        return POSE[joint] if joint < self.free else f"q{self.number(joint)}"

    def force(self, joint: int) -> str:
        """What acts along a joint, in words."""
        if joint >= self.free:
            return f"torque of joint {self.number(joint)}"
        return f"{'force along' if joint < SLIDING else 'moment about the axis of'} {POSE[joint]}"

    @cached_property
    def standard(self) -> tuple[Standard, ...]:
        """All parameters, in the order of the columns: those that stand for others come first.

        The mass of a body, its moment along the axis and one inertia across it can go to the body before.
        """
        out = []
        for k, joint in enumerate(self.joints):
            if k < self.free - 1:
                continue
            along = int(np.argmax(np.abs(joint.axis)))
            across = "xyz"[(along + 2) % 3]
            last = [f"I{across}{across}", f"h{'xyz'[along]}", "m"]
            ranked = [f"I{2 * 'xyz'[along]}", "Ixx", "Iyy", "Izz", "hx", "hy", "hz", "Ixy", "Ixz", "Iyz"]
            first = [one for one in dict.fromkeys(ranked) if one not in last]
            torque = "N" if joint.prismatic else "N*m"
            units = {"m": "kg", "h": "kg*m", "I": "kg*m^2"}
            kinds = {one: units[one[0]] for one in [*first, *last]}
            kinds |= {"Ia": "kg" if joint.prismatic else "kg*m^2"} if joint.rotor is not None else {}
            kinds |= {} if joint.free else {"Fv": "N*s/m" if joint.prismatic else "N*m*s", "Fc": torque}
            kinds |= {"Offset": torque} if joint.offset else {}
            out += [Standard(k, f"{kind}{self.number(k)}", kind, unit) for kind, unit in kinds.items()]
        return tuple(out)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Of the programs: sines and cosines are computed in them."""
        n = range(1, len(self.joints) + 1)
        return (*(f"q{k}" for k in n), *(f"q{k}_1" for k in n))

    @property
    def _all(self) -> tuple[Program, list[tuple[int, int, int]]]:
        return self.program(range(len(self.standard)))

    @cached_property
    def _programs(self) -> dict[tuple[int, ...], tuple[Program, list[tuple[int, int, int]]]]:
        """Those that were asked for: the recursion of 7 joints takes 0.04 s."""
        return {}

    def program(self, columns: Sequence[int]) -> tuple[Program, list[tuple[int, int, int]]]:
        """p_i and -g_i of inertial parameters, from positions and rates, and what each result is: (order of the
        derivative 1 or 0, joint, place in `columns`); those that are 0 are left out."""
        wanted = tuple(columns)
        if wanted not in self._programs:
            self._programs[wanted] = self._traced(wanted)
        return self._programs[wanted]

    def _traced(self, columns: Sequence[int]) -> tuple[Program, list[tuple[int, int, int]]]:
        """See `program`."""
        entries: list[tuple[int, int, int]] = []

        def function(given: list[Traced]) -> list[Number]:
            n = len(self.joints)
            found = []
            wanted = {(self.standard[one].joint, self.standard[one].kind): k for k, one in enumerate(columns)}
            for joint, kind, i, p, g in _momenta(self, given[:n], given[n:], set(wanted)):
                for order, value in ((1, p), (0, 0.0 - g)):
                    if isinstance(value, Traced) or value:
                        entries.append((order, i, wanted[joint, kind]))
                        found.append(value)
            for (joint, kind), column in wanted.items():
                if kind == "Ia":
                    entries.append((1, joint, column))
                    found.append(given[n + joint])
            return found

        return traced(self.arguments, function), entries

    def places(self) -> Program:
        """x, y and z of the points that stay in the box, from the positions: each origin that moves, and the points of
        each body, or its centre of mass where it has none [m]."""

        def function(given: list[Traced]) -> list[Number]:
            found: list[Number] = []
            frames: list[tuple[list[list[Number]], list[Number]]] = []
            for joint, angle in zip(self.joints, given, strict=True):
                turned, at = _frame(joint, angle)
                points = list(joint.points)
                if not points and joint.inertial is not None and joint.inertial[0] > 0:
                    points = [tuple(one / joint.inertial[0] for one in joint.inertial[1:4])]  # type: ignore[list-item]
                if joint.parent >= 0:
                    above, origin = frames[joint.parent]
                    at = _sum(origin, _times(above, at))
                    turned = _transposed([_times(above, column) for column in _transposed(turned)])
                frames.append((turned, at))
                found += at if joint.parent >= 0 or joint.prismatic else []
                for point in points:
                    found += _sum(at, _times(turned, point))
            return found

        return traced(self.arguments[: len(self.joints)], function)

    @cached_property
    def base(self) -> tuple[Base, ...]:
        """What the torques depend on, in the order of the joints: friction behind the inertial parameters of each.

        Each column of the torques at random states depends on those kept before it, or is kept. The derivative of p
        along the motion is exact (complex step).
        """
        n, places = len(self.joints), range(len(self.standard))
        random = np.random.default_rng(0)
        q, v, a = (random.uniform(-3, 3, (n, _STATES)) for _ in range(3))
        rows = np.zeros((len(places), n, _STATES))
        program, entries = self._all
        tiny = 1e-30
        along = evaluated(program, [*(q + 1j * tiny * v), *(v + 1j * tiny * a)])
        for (order, joint, column), value in zip(entries, along, strict=True):
            part = np.broadcast_to(value, _STATES)
            rows[column, joint] += part.imag / tiny if order else part.real
        for column, one in enumerate(self.standard):
            if one.kind in _FRICTION:
                rows[column, one.joint] = _FRICTION[one.kind](v[one.joint])
        flat = rows.reshape(len(places), -1)
        kept: list[int] = []
        of_kept: list[list[tuple[int, float]]] = []
        basis = np.zeros((0, flat.shape[1]))
        for column in places:
            own, size = flat[column], float(np.linalg.norm(flat[column]))
            left = own - basis.T @ (basis @ own)
            left -= basis.T @ (basis @ left)
            if size <= _DEPENDENT:
                continue
            if np.linalg.norm(left) > _DEPENDENT * size:
                basis = np.vstack([basis, left / np.linalg.norm(left)])
                kept.append(column)
                of_kept.append([(column, 1.0)])
                continue
            factors = np.linalg.lstsq(flat[kept].T, own, rcond=None)[0]
            for parts, factor in zip(of_kept, factors, strict=True):
                if abs(factor) > _DEPENDENT * max(1.0, float(np.max(np.abs(factors)))):
                    parts.append((column, float(factor)))
        return tuple(Base(one, tuple(parts)) for one, parts in zip(kept, of_kept, strict=True))

    @property
    def inertial(self) -> int:
        """How many of the base parameters are of the bodies, without rotors and friction."""
        return sum(self.standard[one.standard].kind in INERTIAL for one in self.base)

    def name_of(self, base: Base) -> str:
        """As in Ixx2, or Ixx2_R where others are added to it."""
        return self.standard[base.standard].name + ("_R" if len(base.parts) > 1 else "")

    def closed_form(self, base: Base) -> str:
        """As in "Ixx2 - Iyy2 + 0.16*m3"."""
        text = ""
        for place, factor in base.parts:
            size = f"{abs(factor):.6g}"
            sign = (" - " if factor < 0 else " + ") if text else ("-" if factor < 0 else "")
            text += f"{sign}{'' if size == '1' else f'{size}*'}{self.standard[place].name}"
        return text

    def of_file(self, base: Base) -> float | None:
        """Its value in the file; None: a part of it is not known."""
        total = 0.0
        for place, factor in base.parts:
            one = self.standard[place]
            joint = self.joints[one.joint]
            if one.kind == "Ia" and joint.rotor is not None:
                total += factor * joint.rotor
            elif one.kind in _OF_FILE and joint.friction is not None:
                total += factor * joint.friction[_OF_FILE.index(one.kind)]
            elif one.kind in INERTIAL and joint.inertial is not None:
                total += factor * joint.inertial[INERTIAL.index(one.kind)]
            else:
                return None
        return total


_FRICTION: dict[str, Callable[[Float], Float]] = {
    "Fv": lambda v: v,
    "Fc": lambda v: np.sign(v),
    "Offset": lambda v: np.ones(v.shape),
}


def friction(chain: Chain, columns: Sequence[int]) -> Iterator[tuple[int, int, Callable[[Float], Float]]]:
    """Columns that are no momenta: place in `columns`, joint, and the column from the joint's rate."""
    for place, column in enumerate(columns):
        one = chain.standard[column]
        if one.kind in _FRICTION:
            yield place, one.joint, _FRICTION[one.kind]


def _momenta(
    chain: Chain, q: Sequence[Traced], rates: Sequence[Traced], wanted: set[tuple[int, str]]
) -> Iterator[tuple[int, str, int, Number, Number]]:
    """Body, parameter, joint, p and g of each that is wanted."""
    zero: Vector = (0.0, 0.0, 0.0)
    frames: list[tuple[list[list[Number]], list[Number]]] = []
    motion: list[tuple[Vector, Vector, Vector]] = []
    for joint, angle, rate in zip(chain.joints, q, rates, strict=True):
        axis = [_snapped(one) for one in joint.axis]
        w, v, down = motion[joint.parent] if joint.parent >= 0 else (zero, zero, chain.gravity)
        turned, place = _frame(joint, angle)
        back = _transposed(turned)
        v, w, down = _times(back, _sum(v, _cross(w, place))), _times(back, w), _times(back, down)
        if joint.prismatic:
            v = _sum(v, [one * rate for one in axis])
        else:
            w = _sum(w, [one * rate for one in axis])
        frames.append((turned, place))
        motion.append((w, v, down))
    for j, joint in enumerate(chain.joints):
        w, v, down = motion[j]
        for kind in INERTIAL:
            if (j, kind) not in wanted:
                continue
            momentum, moment, force = (zero, zero), zero, zero
            if kind == "m":
                momentum, force = (zero, v), down
            elif kind[0] == "h":
                one = [float(kind[1] == axis) for axis in "xyz"]
                momentum, moment = (_cross(one, v), _cross(w, one)), _cross(one, down)
            else:
                a, b = _PRODUCTS[INERTIAL.index(kind) - 4]
                spin: list[Number] = [0.0, 0.0, 0.0]
                spin[a], spin[b] = w[b], w[a]
                momentum = (spin, zero)
            angular, linear = momentum
            i = j
            while i >= 0:
                joint, (wi, vi, _) = chain.joints[i], motion[i]
                axis = [_snapped(one) for one in joint.axis]
                if joint.prismatic:
                    yield j, kind, i, _dot(axis, linear), _dot(axis, _sum(_cross(linear, wi), force))
                else:
                    turning = _sum(_cross(angular, wi), _cross(linear, vi))
                    yield j, kind, i, _dot(axis, angular), _dot(axis, _sum(turning, moment))
                turned, place = frames[i]
                linear, force = _times(turned, linear), _times(turned, force)
                angular = _sum(_times(turned, angular), _cross(place, linear))
                moment = _sum(_times(turned, moment), _cross(place, force))
                i = joint.parent


def _frame(joint: Joint, angle: Traced) -> tuple[list[list[Number]], list[Number]]:
    """Of its body in its parent's: rotation, and origin."""
    fixed: list[list[Number]] = [[_snapped(one) for one in row] for row in joint.turned]
    axis = [_snapped(one) for one in joint.axis]
    if joint.prismatic:
        return fixed, _sum(joint.origin, [one * angle for one in _times(fixed, axis)])
    return [_times(_transposed(_rotation(axis, angle)), row) for row in fixed], list(joint.origin)


def _snapped(value: float) -> float:
    nearest = float(round(value))
    return nearest if abs(value - nearest) < _SNAPPED else value


def _rotation(axis: Sequence[float], angle: Traced) -> list[list[Number]]:
    """About a unit vector."""
    s, c = angle.sin(), angle.cos()
    out: list[list[Number]] = []
    for i in range(3):
        row: list[Number] = []
        for j in range(3):
            product = _snapped(axis[i] * axis[j])
            if i == j:
                row.append(1.0 if product == 1 else product + (1 - product) * c)
            else:
                sign = 1.0 if (j - i) % 3 == 2 else -1.0
                row.append(product - product * c + sign * axis[3 - i - j] * s)
        out.append(row)
    return out


def rotation_of(rpy: Sequence[float]) -> tuple[tuple[float, ...], ...]:
    """Of roll, pitch and yaw [rad], as URDF has them: about the fixed x, y and z in turn."""
    (sr, sp, sy), (cr, cp, cy) = ([f(one) for one in rpy] for f in (math.sin, math.cos))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def _sum(a: Vector, b: Vector) -> list[Number]:
    return [x + y for x, y in zip(a, b, strict=True)]


def _dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> list[Number]:
    return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]


def _times(matrix: Sequence[Vector], vector: Vector) -> list[Number]:
    return [_dot(row, vector) for row in matrix]


def _transposed(matrix: Sequence[Vector]) -> list[list[Number]]:
    return [list(one) for one in zip(*matrix, strict=True)]
