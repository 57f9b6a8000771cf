"""A motion that determines the base parameters of a robot, within its limits.

Each joint follows q = c + e(t) sum_k (a_k sin w_k t + b_k cos w_k t): a periodic series, whose soft start and stop e is
that of pvid_excite_f32. The torques are Y(q, q', q'') p; with the noise sd_i of each of them the information of the
motion is S = sum Y_i^T Y_i / sd_i^2, and c, a and b minimise the mean logarithm of the standard errors, which does not
depend on units (J. Swevers, C. Ganseman et al., IEEE T-RA 13 (1997) 730, with the determinant).

What leaves `fitted` keeps the limits: amplitudes are taken back until it does, towards the centre c, which keeps them.
Between the steps of its grid a function is at most h^2/8 max |f''| further out; of positions and rates the bound is
that of the series, of torques and points twice the largest second difference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.model.chain import Chain, Joint, friction
from pvid.model.compiled import CompiledModel
from pvid.model.operations import differentiated, evaluated
from pvid.oracle.weak.robot import RobotFit, identify_robot, shortest_run

Float = npt.NDArray[np.float64]

TONES = 8
_RAMP_S, _RAMP = 1.0, 0.1  # longest, and part of the duration
_LONGEST_S = 600.0
_TINY = 1e-30  # complex step
_PER_PERIOD, _FEWEST = 10, 200  # steps of the search's grid, in the shortest period, and in all
_FINE = 2e-3  # step of the grid on which limits are checked, at most [s]
_TICKS = 2000  # computed at a time
_INSIDE = 0.97  # of the limits: where the search stays
_PENALTIES, _TURNS = (1e2, 1e3, 1e4), 80  # weights of what is outside, and iterations with each
_SHRUNK, _LEAST = 0.97, 0.02
_POSES = 300
_SLOW = 0.25  # of the largest rate: there a row counts half
_MOST_HZ = 2.0
_NOISE = 0.01  # of the largest torque
_RIDGE = 1e-10  # of the information of each parameter
_BOX = 0.1  # [m] outside that weigh as a whole limit


@dataclass(frozen=True)
class Series:
    """Positions of joints.

    Attributes
    ----------
    centre : [n]
    waves : a, then b [n, 2 K]
    hz : [K]
    duration, ramp_s : in all, and of the soft start and of the soft stop [s]
    """

    centre: Float
    waves: Float
    hz: Float
    duration: float
    ramp_s: float

    def basis(self, t: Float, ramped: npt.NDArray[np.bool_] | None = None) -> Float:
        """[3, times, 2 K]: what a and b are multiplied with in q, q' and q''; `ramped`: which times are of a ramp."""
        if ramped is None:
            ramped = (t < self.ramp_s) | (t > self.duration - self.ramp_s)
        late = t > self.duration / 2
        x = np.where(ramped, np.clip(np.where(late, self.duration - t, t) / self.ramp_s, 0.0, 1.0), 1.0)
        e = [x * x * (3 - 2 * x), np.where(late, -6, 6) * x * (1 - x) / self.ramp_s, (6 - 12 * x) / self.ramp_s**2]
        e = [e[0][:, np.newaxis], *(np.where(ramped, one, 0.0)[:, np.newaxis] for one in e[1:])]
        w = 2 * math.pi * self.hz
        s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        turns = [np.hstack([s, c]), np.hstack([w * c, -w * s]), np.hstack([-w * w * s, -w * w * c])]
        return np.array([e[0] * turns[0], e[1] * turns[0] + e[0] * turns[1],
                         e[2] * turns[0] + 2 * e[1] * turns[1] + e[0] * turns[2]])  # fmt: skip

    def at(self, basis: Float) -> Float:
        """Positions, rates and accelerations [3, n, times]."""
        out = self.waves @ basis.transpose(0, 2, 1)
        out[0] += self.centre[:, np.newaxis]
        return np.asarray(out)

    def samples(self, rate: float) -> tuple[Float, Float]:
        """Times [s], and `at` them."""
        t = np.arange(round(self.duration * rate) + 1) / rate
        return t, self.at(self.basis(t))

    def slopes(self, order: int) -> Float:
        """Bound of the derivative of the positions [n]."""
        sizes, w = np.hypot(*np.split(self.waves, 2, axis=1)), 2 * math.pi * self.hz
        e = [1.0, 1.5 / self.ramp_s, 6 / self.ramp_s**2, 12 / self.ramp_s**3]
        return np.asarray(sum(math.comb(order, k) * e[k] * (sizes @ w ** (order - k)) for k in range(order + 1)))


@dataclass(frozen=True)
class Motion:
    """A designed motion.

    Attributes
    ----------
    model, series : of the robot
    rate : of its ticks [Hz]
    noise : of each torque [n]
    gain : standard errors of a multisine within the same limits over those of the motion, geometric mean
    used : largest part of a limit that each of position, speed, torque and box takes; None: there is no such limit
    """

    model: CompiledModel
    series: Series
    rate: float
    noise: Float
    gain: float
    used: dict[str, float | None]

    @property
    def chain(self) -> Chain:
        """Of the robot."""
        return _chain_of(self.model)

    def predicted(self) -> RobotFit:
        """What `pvid identify` finds on a simulated recording of it; values are those of the file, else 0."""
        chain = self.chain
        t, (q, v, a) = self.series.samples(self.rate)
        random = np.random.default_rng(0)
        torque = np.concatenate(list(Task(self.model, self.series, self.noise).torques(q, v, a)), axis=1)
        torque += self.noise[:, np.newaxis] * random.normal(size=torque.shape)
        run = {"t": t}
        for k in range(len(chain.joints)):
            step = self.model.signal(f"q{k + 1}").resolution
            run[f"q{k + 1}"] = np.round(q[k] / step + 0.3 * random.normal(size=len(t))) * step
            constant = {one.name: one.value for one in self.model.knowns}.get(f"kt{k + 1}")
            run[f"tau{k + 1}" if constant is None else f"i{k + 1}"] = torque[k] / (constant or 1.0)
        return identify_robot(self.model, run, self.rate)


def _chain_of(model: CompiledModel) -> Chain:
    assert model.chain is not None
    return model.chain


class Task:
    """A robot with limits, noise and a grid of times."""

    def __init__(self, model: CompiledModel, series: Series, noise: Float | None = None) -> None:
        chain = _chain_of(model)
        if chain.free:
            raise PvidError("a motion is designed for robots on a fixed base, and this base is free")
        self.model, self.chain, self.series, self.n = model, chain, series, len(chain.joints)
        self.low, self.high, self.speed = _reach(chain.joints)
        self.columns = [one.standard for one in chain.base]
        self.program, self.entries = chain.program(self.columns)
        self.others = list(friction(chain, self.columns))
        self.most = np.array([one.torque or math.inf for one in chain.joints])
        values = [chain.of_file(one) for one in chain.base]
        self.p = np.array([0.0 if one is None else one for one in values])
        lost = [
            k for one, k in zip(values, chain.base, strict=True) if one is None and not self._is_friction(k.standard)
        ]
        if lost and np.isfinite(self.most).any():
            raise PvidError("a limit of a torque needs the inertias of all bodies: give each joint its inertial")
        self.dry = np.array([(one.friction or (0.0, 0.0))[1] for one in chain.joints])
        self.places = None if chain.box is None else chain.places()
        if self.places is not None and not self.places.results:
            raise PvidError("the box holds nothing: no joint has points, or a centre of mass by its inertial")
        if noise is None:
            noise = np.array([one.noise or _NOISE * (one.torque or 0.0) for one in chain.joints])
            if not noise.all():
                first = chain.joints[int(np.argmin(noise > 0))].name
                raise PvidError(
                    f"{first} has neither a limit nor a noise of its torque: model.joint({first!r}, .., torque=50)"
                )
        self.noise = noise

    def _is_friction(self, column: int) -> bool:
        return self.chain.standard[column].kind in ("Fv", "Fc", "Offset")

    @property
    def hertz(self) -> Float:
        """Where a joint that uses all of its range reaches all of its speed [n]."""
        return np.asarray(self.speed / (math.pi * (self.high - self.low)))

    @cached_property
    def coarse(self) -> Float:
        """Basis on the grid of the search."""
        wanted = int(_PER_PERIOD * self.series.hz.max() * self.series.duration)
        return self.series.basis(np.linspace(0, self.series.duration, max(wanted, _FEWEST)))

    @cached_property
    def fine(self) -> list[Float]:
        """Bases on the grids of soft start, middle and soft stop, each with both ends."""
        edges = [0.0, self.series.ramp_s, self.series.duration - self.series.ramp_s, self.series.duration]
        out = []
        for k in range(3):
            t = np.linspace(edges[k], edges[k + 1], int((edges[k + 1] - edges[k]) / _FINE) + 2)
            out.append(self.series.basis(t, np.full(t.shape, k != 1)))
        return out

    def values(self, q: Float, v: Float, a: Float) -> list[npt.NDArray[np.complex128]]:
        """The program's results; their imaginary parts over _TINY are their derivatives by time."""
        return evaluated(self.program, [*(q + 1j * _TINY * v), *(v + 1j * _TINY * a)])

    def rows(self, q: Float, v: Float, found: list[npt.NDArray[np.complex128]]) -> Float:
        """Y [n, p, times] from the program's results."""
        out = np.zeros((self.n, len(self.columns), q.shape[1]))
        for (order, joint, place), one in zip(self.entries, found, strict=True):
            out[joint, place] += np.imag(one) / _TINY if order else np.real(one)
        for place, joint, column in self.others:
            out[joint, place] = column(v[joint])
        return out

    def weights(self, v: Float) -> Float:
        """Of the rows of each joint [n, times]: slow steps are in doubt (pvid.oracle.weak.robot), over the noise."""
        return np.asarray(v**2 / (v**2 + (_SLOW * self.speed[:, np.newaxis]) ** 2) / self.noise[:, np.newaxis])

    def torques(self, q: Float, v: Float, a: Float, p: Float | None = None) -> Iterator[Float]:
        """At the values of the file, or at p [n, times], so many at a time."""
        p = self.p if p is None else p
        for first in range(0, q.shape[1], _TICKS):
            own = slice(first, first + _TICKS)
            found = self.values(q[:, own], v[:, own], a[:, own])
            out = np.zeros(q[:, own].shape)
            for (order, joint, place), one in zip(self.entries, found, strict=True):
                out[joint] += p[place] * (np.imag(one) / _TINY if order else np.real(one))
            for place, joint, column in self.others:
                out[joint] += p[place] * column(v[joint, own])
            yield out

    def outside(self, points: Float) -> Float:
        """How far points [3 points, times] are outside the box [m]; below 0 inside."""
        assert self.chain.box is not None
        low, high = (np.tile(one, len(points) // 3)[:, np.newaxis] for one in self.chain.box)
        return np.asarray(np.maximum(low - points, points - high))

    # ---- limits

    def used(self, series: Series) -> dict[str, float | None]:
        """Largest part of a limit, which is 1, that a motion takes; of the box 1 and what is outside in metres."""
        out: dict[str, float | None] = {"position": 0.0, "speed": 0.0}
        out |= {
            "torque": 0.0 if np.isfinite(self.most).any() else None,
            "box": None if self.places is None else -math.inf,
        }
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        for basis, length in zip(
            self.fine, (series.ramp_s, series.duration - 2 * series.ramp_s, series.ramp_s), strict=True
        ):
            q, v, a = series.at(basis)
            between = (length / (basis.shape[1] - 1)) ** 2 / 8
            position = (np.abs(q - middle[:, np.newaxis]).max(axis=1) + between * series.slopes(2)) / half
            speed = (np.abs(v).max(axis=1) + between * series.slopes(3)) / self.speed
            found = {"position": position.max(), "speed": speed.max()}
            if out["torque"] is not None:
                # Dry friction is no curve: all of it counts, in whichever direction.
                smooth = np.concatenate(list(self.torques(q, v, a, self._smooth)), axis=1)
                found["torque"] = ((_peak(np.abs(smooth), smooth) + self.dry) / self.most).max()
            if self.places is not None:
                points = np.array([np.broadcast_to(one, q.shape[1:]) for one in evaluated(self.places, q)])
                found["box"] = 1 + _peak(self.outside(points), points).max()
            for name, one in found.items():
                out[name] = max(float(one), out[name] or -math.inf)
        return out

    def fitted(self, series: Series) -> Series | None:
        """The largest motion of this shape that keeps the limits; None: not even its centre keeps them."""
        q, v, _ = series.at(np.concatenate(self.fine, axis=1))
        between = _FINE**2 / 8
        more = between * series.slopes(2)
        centre = np.clip(series.centre, self.low, self.high)
        up, down = (q.max(axis=1) - series.centre + more, series.centre - q.min(axis=1) + more)
        factors = [(self.high - centre) / up, (centre - self.low) / down]
        factors += [self.speed / (np.abs(v).max(axis=1) + between * series.slopes(3))]
        waves = series.waves * np.minimum(np.min(factors, axis=0) * (1 - 1e-9), 1.0)[:, np.newaxis]
        scale = 1.0
        while scale > _LEAST:
            found = replace(series, centre=centre, waves=waves * scale)
            used = self.used(found)
            if max(one for one in used.values() if one is not None) <= 1.0:
                return found
            scale *= _SHRUNK if (used["torque"] or 0.0) < 2 else 0.8
        return None

    def centred(self) -> Float:
        """A pose that keeps the limits: the middle of the ranges, or one at random that is farthest from the box."""
        middle, random = (self.high + self.low) / 2, np.random.default_rng(0)
        poses = [middle, *random.uniform(self.low, self.high, (_POSES, self.n))]
        q = np.array(poses).T
        still = np.concatenate(list(self.torques(q, 0 * q, 0 * q)), axis=1)
        parts = (np.abs(still) + self.dry[:, np.newaxis]) / self.most[:, np.newaxis]
        bad = np.max(parts, axis=0) - 1
        if self.places is not None:
            points = np.array([np.broadcast_to(one, q.shape[1:]) for one in evaluated(self.places, q)])
            bad = np.maximum(bad, self.outside(points).max(axis=0) / _BOX)
        best = int(np.argmin(bad)) if bad[0] > -0.5 else 0
        if bad[best] >= 0:
            worst = int(np.argmax(parts[:, best]))
            why = f"{self.chain.joints[worst].name} needs {parts[worst, best]:.0%} of its torque" if parts[
                worst, best] >= 1 else "a point is outside the box"  # fmt: skip
            raise PvidError(f"no pose that was tried holds the robot still within its limits: {why}")
        return np.asarray(poses[best])

    # ---- information

    def cost(self, series: Series, penalty: float = 0.0) -> tuple[float, Float]:
        """Mean logarithm of the standard errors, but for a constant, with the weighted squares of what is outside the
        limits; and its derivative by centre and waves."""
        q, v, a = series.at(self.coarse)
        times = q.shape[1]
        found, back = differentiated(self.program, [*(q + 1j * _TINY * v), *(v + 1j * _TINY * a)])
        y = self.rows(q, v, [np.broadcast_to(one, times) for one in found])
        weights = self.weights(v)[:, np.newaxis]
        white = y * weights
        c = _inverse(white)
        cost = 0.5 * float(np.mean(np.log(np.diag(c))))
        # d cost = -1/2 tr(dS C D C), with C the inverse of S and D that of its diagonal.
        m = (c / np.diag(c)) @ c / (len(self.p) * times)
        by_y = -np.einsum("pr,irt->ipt", m, white, optimize=True)
        by_q, by_v, slow = np.zeros(q.shape), np.zeros(q.shape), _SLOW * self.speed[:, np.newaxis]
        by_rate = np.sum(by_y * y, axis=1) * 2 * v * slow**2 / (v**2 + slow**2) ** 2 / self.noise[:, np.newaxis]
        by_y *= weights

        def outside(x: Float, limit: Float | float) -> tuple[float, Float]:
            """Of |x| beyond a limit: what it adds, and its derivative by x."""
            over = np.maximum(np.abs(x) / limit - _INSIDE, 0.0)
            return penalty * float(np.sum(over**2)) / times, 2 * penalty * over * np.sign(x) / limit / times

        if penalty:
            middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
            for x, limit, by in ((q - middle[:, np.newaxis], half, by_q), (v, self.speed, by_v)):
                more, slope = outside(x, limit[:, np.newaxis])
                cost, by[:] = cost + more, slope
            if np.isfinite(self.most).any():
                limit = (self.most - self.dry)[:, np.newaxis]
                more, slope = outside(np.einsum("ipt,p->it", y, self._smooth), limit)
                cost += more
                by_y += slope[:, np.newaxis] * self._smooth[:, np.newaxis]
            if self.places is not None:
                points, pull = differentiated(self.places, q)
                far = self.outside(np.array([np.broadcast_to(one, times) for one in points])) / _BOX + 0.02
                over = np.maximum(far, 0.0)
                cost += penalty * float(np.sum(over**2)) / times
                low = np.tile(self.chain.box[0], len(points) // 3)[:, np.newaxis]  # type: ignore[index]
                inwards = np.where(np.array([np.broadcast_to(one, times) for one in points]) < low + _BOX * 0.02, -1, 1)
                by_q += np.array(pull(2 * penalty * over * inwards / _BOX / times) + [np.zeros(times)])[:-1]
        back_of = back([by_y[joint, place] * (1.0 if order else 1j * _TINY) for order, joint, place in self.entries])
        slopes = np.array([np.broadcast_to(one, times) for one in back_of])
        by_q += slopes[: self.n].imag / _TINY
        by_v += by_rate + slopes[: self.n].real + slopes[self.n :].imag / _TINY
        by_a = slopes[self.n :].real
        for place, joint, _ in self.others:
            if self.chain.standard[self.columns[place]].kind == "Fv":
                by_v[joint] += by_y[joint, place]
        waves = sum(one @ basis for one, basis in zip((by_q, by_v, by_a), self.coarse, strict=True))
        return cost, np.hstack([by_q.sum(axis=1, keepdims=True), waves]).reshape(-1)

    @cached_property
    def _smooth(self) -> Float:
        """p without dry friction."""
        dry = [self.chain.standard[one].kind == "Fc" for one in self.columns]
        return np.where(dry, 0.0, self.p)

    def improved(self, series: Series, turns: int) -> Series:
        """The best of what the search finds from here, within the limits."""
        from scipy.optimize import minimize  # a quarter of a second

        def moved(x: Float) -> Series:
            whole = x.reshape(self.n, -1)
            return replace(series, centre=whole[:, 0], waves=whole[:, 1:])

        best, here = series, np.hstack([series.centre[:, np.newaxis], series.waves]).reshape(-1)
        for penalty in _PENALTIES:
            here = minimize(
                lambda x, weight=penalty: self.cost(moved(x), weight), here, jac=True, method="L-BFGS-B",
                options={"maxiter": turns},
            ).x  # fmt: skip
            found = self.fitted(moved(here))
            if found is not None and self.cost(found)[0] < self.cost(best)[0]:
                best = found
        return best


def _inverse(white: Float) -> Float:
    """Of the mean of Y^T Y, from [n, p, times]."""
    flat = white.transpose(1, 0, 2).reshape(white.shape[1], -1)
    size = np.sqrt(np.einsum("pk,pk->p", flat, flat) / white.shape[2]) + 1e-12
    flat = flat / size[:, np.newaxis]
    inverse = np.linalg.inv(flat @ flat.T / white.shape[2] + _RIDGE * np.eye(len(size)))
    return np.asarray(inverse / np.outer(size, size))


def _peak(sizes: Float, values: Float) -> Float:
    """Largest of each row, with what may be between its steps."""
    return np.asarray(sizes.max(axis=-1) + np.abs(np.diff(values, 2, axis=-1)).max(axis=-1, initial=0.0) / 4)


def _reach(joints: Sequence[Joint]) -> tuple[Float, Float, Float]:
    """Least and largest position, and speed [joints]."""
    fast = [one for one in joints if one.speed is None]
    if fast:
        raise PvidError(_without(fast, "limit of its speed", "limits of their speeds", "speed=1.5"))
    far = [one for one in joints if one.limits is None and one.prismatic]
    if far:
        raise PvidError(_without(far, "limits", "limits", "limits=(0, 0.5)"))
    reach = [(*(one.limits or (-math.pi, math.pi)), one.speed or 0.0) for one in joints]
    low, high, speed = np.array(reach).T
    return low, high, speed


def _without(joints: Sequence[Joint], one: str, several: str, typed: str) -> str:
    names = listed(joint.name for joint in joints)
    lacking = f"{names} has no {one}" if len(joints) == 1 else f"{names} have no {several}"
    return f"{lacking}: model.joint({joints[0].name!r}, .., {typed})"


def simple_drives(model: CompiledModel, duration: float, rate: float = 1000.0) -> list[tuple[Task, Series]]:
    """Multisines of equal amplitudes with Schroeder's phases in three bands, as large as the limits let them be."""
    shortest = math.ceil(10 * shortest_run(rate)) / 10
    if not shortest <= duration <= _LONGEST_S:
        raise PvidError(f"a motion of {duration:g} s: --duration must be from {shortest:g} to {_LONGEST_S:g}")
    ramp, duration = (round(one * rate) / rate for one in (min(_RAMP_S, _RAMP * duration), duration))
    burst, n = duration - 2 * ramp, len(_chain_of(model).joints)
    series = Series(np.zeros(n), np.zeros((n, 2 * TONES)), np.ones(TONES), duration, ramp)
    first = Task(model, series)
    centre = first.centred()
    out = []
    for top in np.geomspace(max(TONES / burst, min(np.median(first.hertz), _MOST_HZ)), _MOST_HZ, 3):
        spread = np.geomspace(1, max(top * burst, TONES), TONES)
        multiples: list[int] = []
        for one in spread:
            multiples.append(max(round(one), multiples[-1] + 1 if multiples else 1))
        hz = np.array(multiples) / burst
        turns = (
            np.array([-(k * (k - 1)) / (2 * TONES) for k in range(TONES)]) + 0.38196601 * np.arange(n)[:, np.newaxis]
        )
        waves = np.hstack([np.cos(2 * math.pi * turns), np.sin(2 * math.pi * turns)])
        sizes = first.speed[:, np.newaxis] / np.sqrt(TONES) / (2 * math.pi * hz.mean())
        shape = replace(series, centre=centre, hz=hz, waves=waves * sizes)
        task = Task(model, shape, first.noise)
        if (found := task.fitted(shape)) is not None:
            out.append((task, found))
    if not out:
        raise PvidError(
            "no motion keeps the limits: widen the box or the torques, or name other `limits` of the joints"
        )
    return out


def designed_motion(model: CompiledModel, duration: float, rate: float = 1000.0, turns: int = _TURNS) -> Motion:
    """A motion of a robot within the limits of its model file.

    Parameters
    ----------
    duration : soft start and soft stop included [s]
    rate : of its ticks [Hz]
    turns : iterations of each search

    Raises
    ------
    PvidError
        Where a limit is missing, or nothing keeps the limits.
    """
    drives = simple_drives(model, duration, rate)
    found = [(task, task.improved(one, turns)) for task, one in drives]
    costs = [[task.cost(one)[0] for task, one in some] for some in (drives, found)]
    task, series = found[int(np.argmin(costs[1]))]
    return Motion(model, series, rate, task.noise, math.exp(min(costs[0]) - min(costs[1])), task.used(series))
