"""Base parameters of a robot from a run, by the weak form of pvid.model.chain.

A row is -sum chi' p_i - sum chi g_i + sum chi friction = sum chi tau_i over a window, of each joint i and test function
chi: linear in the base parameters, without accelerations. Rows of a joint have the covariance sum_m s_im gram(m, m),
m = 0, 1, 2: white noise of the torque, of the momentum and of its integral, as large as the residuals show.

Dry friction of a slow joint is no sgn: it sticks, is soft, or follows a Stribeck curve. Whatever it does in the slow
steps of a window, the rows of its joint have it in the range of sum chi chi^T over these steps, which is projected out.

Noise of the encoders is in the regressors as well, in the rates even squared. What that adds to the normal equations
S p = F is computed from the run: as much noise is added again, and subtracted, and the mean growth of S and F is taken
off (simulation extrapolation: J. Cook, L. Stefanski, JASA 89 (1994) 1314). The draws of that noise differ in what is
quadratic in it: as much the recording has, and the mean of the draws has its part. Both are in the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.chain import POSE, SLIDING, WRENCH, Chain, friction
from pvid.model.compiled import CompiledModel
from pvid.model.operations import evaluated
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import filtered, of_hold, samples_of, segments_of
from pvid.oracle.weak.functions import Float, TestFunctions
from pvid.oracle.weak.solve import RIDGE, inverse, solved

POLYNOMIAL, _SHORTEST, _LONGEST = 4, 7, 61  # degree and taps of what gives positions and rates
_BLURRED = 1.2  # of the noise of a rate: what a longer polynomial may change
_SHORTEST_S, _LONGEST_S, _WINDOWS = 0.5, 1.0, 15  # of a window, and how many the run has of them end to end
_POWER, _FEWEST, _MOST = 4, 21, 49  # of the test functions
_MOTION = 0.999  # of the energy of the rates: the test functions reach twice the frequency below which it is
_CLEAR = 10.0  # times the power of the noise
_LEAST_HZ = 100.0
_STEPS = 2000  # at a time
_TURNS, _DRAWS = 4, 4
_COVERED = 0.1  # of the torques: what a standard error may be worth
_FEWEST_WINDOWS = 8
_SLOW = 0.1  # of the root mean square of a rate: below it dry friction is in doubt
_FAST = 0.4  # likewise: below it a joint is slow
_CLEAR_RATE = 3.0  # of the noise of a rate, likewise
_REACHED = 1e-6  # of the energy of a direction: what slow steps have of it
_BENT = 1e-3  # of an acceleration: what a longer polynomial may take
_BINS = 16  # of a spectrum, of whose mean chance makes _CLEAR times the noise in none
_MOST_NOISE = 0.6  # of S in a direction: beyond it the correction of S is no better than its own noise
_LEANS = 0.04  # of a variance, in such directions: five times their standard error is one of the whole
_RIDGE = 1e-9  # of the variances, as rows depend on each other
_MOST_BYTES = 4e9  # of the rows, with what is computed from them
_HIDDEN = 0.9  # of the energy of a spring's torque
_TERMS = 3  # that may be missing; as many as joints, if these are more
ALIKE = 2.0  # times as sure: friction that is soft where that of another joint is
_DIRECTION = 1e-6  # relative size of a direction that is one
_UPRIGHT = 1.4  # [rad] of pitch, above which yaw and roll turn about nearly the same axis


def _slow(_: Float, v: Float) -> Float:
    size = np.sqrt(np.mean(v**2, axis=1, keepdims=True))
    return np.asarray(np.sign(v) * ((np.abs(v) > _SLOW * size) & (np.abs(v) < _FAST * size)))


LAWS: Mapping[str, Callable[[Float, Float], Float]] = {  # of positions and rates of all joints [n, steps]
    "q": lambda q, v: q,
    "1": lambda q, v: np.ones(q.shape),
    "abs(v)*v": lambda q, v: np.abs(v) * v,
    "slow": _slow,
    "v": lambda q, v: v,
}
GAIN = "gain"  # of a recorded torque, in a robot of several: a law whose column is the predicted torque
LATE = "late"  # recorded torque, of a joint or of EVERY one: the slope of the torque
LOADED, DEAD = "loaded", "dead"  # friction that grows with the load of its joint; a dead band of a torque
ZERO, RATIO, SOFT = "zero", "ratio", "soft"  # what an encoder reads beside the position: 1, the position and the load
EVERY = -1  # joint
_OF_FREE = ("1", "abs(v)*v", "v")  # of the joints of a free base; the others have friction
_PREDICTED = (LOADED, DEAD, ZERO, RATIO, SOFT)  # laws whose columns are computed with the parameters
_POSITIVE = (LOADED, DEAD, SOFT)
_THINNED = 8  # of the taps of the polynomials: steps at which the torques' slopes over the positions are computed
_SMALL = 1e-6  # change of a position or rate
_FIRST = 0.5  # of the torques, of a position, of 1 rad: what is small enough for a first order


def terms_of(chain: Chain) -> list[tuple[str, int]]:
    """(law, joint) of what a robot may have beyond its equations."""
    joints = range(len(chain.joints))
    terms = [(law, k) for law in LAWS for k in joints if ((law in _OF_FREE) if k < chain.free else law != "v")]
    own = [k for k in joints if k >= chain.free]
    if len(joints) > 1:
        terms += [(GAIN, k) for k in own]
    if len(own) > 1:
        terms.append((LATE, EVERY))
    return terms + [(law, k) for law in (LATE, *_PREDICTED) for k in own]


def shortest_run(sample_rate: float) -> float:
    """Length of the shortest recording that is identified [s].

    Raises PvidError where the rate [Hz] is too low.
    """
    if sample_rate < _LEAST_HZ:
        raise PvidError(f"{sample_rate:g} samples a second are too few for a robot: {_LEAST_HZ:g} or more")
    return (_FEWEST_WINDOWS + 1) * _SHORTEST_S / 2 + _LONGEST / sample_rate


@dataclass(frozen=True)
class RobotDesign:
    """Of the windows of a run.

    Attributes
    ----------
    sample_rate : [Hz]
    taps : samples of the polynomials
    functions : test functions
    sd : white noise of each encoder's samples [n]
    still : part of the samples in which each encoder stays on its count [n]
    """

    sample_rate: float
    taps: int
    functions: TestFunctions
    sd: Float
    still: Float


class RobotRun:
    """Positions and torques [n, samples] of each segment of a run, and the joints that nothing drives.

    Raises PvidError where a free base stands upright, or nothing drives any joint.
    """

    def __init__(self, model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float) -> None:
        assert model.chain is not None
        self.model, self.chain, self.sample_rate = model, model.chain, sample_rate
        samples = samples_of(model, run)
        constants = {one.name: one.value for one in model.knowns}
        self.positions: list[Float] = []
        self.torques: list[Float] = []
        for part in segments_of(samples):
            positions, torques = [], []
            for joint in range(len(self.chain.joints)):
                q = samples[self.chain.position(joint)][part]
                turns = SLIDING <= joint < self.chain.free
                positions.append(np.unwrap(q) if turns and POSE[joint] != "pitch" else q)
            if self.chain.free:
                upright = float(np.max(np.abs(positions[POSE.index("pitch")])))
                if upright > math.pi / 2:
                    raise PvidError(
                        f"pitch reaches {upright:.3g}, and is at most pi/2 rad: is it in degrees? "
                        "--columns pitch=pitch:deg"
                    )
                if upright > _UPRIGHT:
                    raise PvidError(
                        f"pitch reaches {math.degrees(upright):.0f} degrees, where yaw and roll turn about one axis: "
                        f"turn the frame of the free base such that it stays below {math.degrees(_UPRIGHT):.0f}"
                    )
                wrench = [samples.get(name, np.zeros(part.stop))[part] for name in WRENCH]
                held = any(one.name in WRENCH and one.hold == "zoh" for one in model.signals)
                torques += _generalised(list(map(of_hold, wrench)) if held else wrench, positions[SLIDING : len(POSE)])
            for k in range(1, len(self.chain.joints) - self.chain.free + 1):
                name = f"tau{k}" if f"tau{k}" in samples else f"i{k}"
                held = model.signal(name).hold == "zoh"
                torque = samples[name][part] * constants.get(f"kt{k}", 1.0)
                torques.append(of_hold(torque) if held else torque)
            self.positions.append(np.array(positions))
            self.torques.append(np.array(torques))
        driven = [any(np.any(one[k]) for one in self.torques) for k in range(len(self.chain.joints))]
        self.idle = [k for k, one in enumerate(driven) if not one]
        if self.torques and not any(driven):
            raise PvidError("every torque is 0 at all times: a motion without a known force has no parameters")
        if self.torques and (still := [k for k in self.idle if k >= self.chain.free]):
            raise PvidError(
                f"the {self.chain.force(still[0])} is 0 in every sample: is it recorded? A joint that nothing drives "
                "can be held, and left out of `pvid model from --joints`"
            )

    @cached_property
    def design(self) -> RobotDesign:
        """The longest polynomials that blur nothing visible, and windows for the band of the motion."""
        rate = self.sample_rate
        shortest_run(rate)
        parts = [one for one in self.positions if one.shape[1] > 2 * _LONGEST]
        if not parts:
            raise PvidError(f"the run has no {2 * _LONGEST} samples without a gap: record longer")
        whole = max(parts, key=lambda one: one.shape[1])
        inner = slice(_LONGEST, -_LONGEST)
        short = polynomial_weights(_SHORTEST, POLYNOMIAL, 0)
        left = (whole - self.smoothed(whole, _SHORTEST, 0))[:, inner]
        rates, taps = self.smoothed(whole, _SHORTEST, 1)[:, inner], _SHORTEST
        motion = np.abs(self.smoothed(whole, _LONGEST, 1)[:, inner])
        moves = motion >= _SLOW * np.sqrt(np.mean(motion**2, axis=1, keepdims=True))  # at rest rounding hides the noise
        sd = np.sqrt(_mean_square(left, moves) / (1 - short[_SHORTEST // 2]))
        w, bends = _bending(whole, sd)
        sines = np.sin(np.outer(w, np.arange(1, _LONGEST // 2 + 1)))
        for longer in range(_SHORTEST + 2, _LONGEST + 1, 2):
            apart = self.smoothed(whole, longer, 1)[:, inner] - rates
            weights = polynomial_weights(longer, POLYNOMIAL, 1).copy()
            inner_taps = slice((longer - _SHORTEST) // 2, (longer + _SHORTEST) // 2)
            weights[inner_taps] -= polynomial_weights(_SHORTEST, POLYNOMIAL, 1)
            if np.any(_mean_square(apart, moves) > _BLURRED * (sd * rate) ** 2 * np.sum(weights**2)):
                break
            rates_off = 2 * sines[:, : longer // 2] @ polynomial_weights(longer, POLYNOMIAL, 1)[longer // 2 + 1 :] - w
            if np.any(bends @ rates_off**2 > _BENT**2):
                break
            taps = longer
        smooth = self.smoothed(whole, taps, 1)[:, inner]
        still = np.mean(np.diff(whole, axis=1) == 0, axis=1)
        power = np.abs(np.fft.rfft(smooth - smooth.mean(axis=1, keepdims=True))) ** 2
        gain = np.abs(np.fft.rfft(polynomial_weights(taps, POLYNOMIAL, 1) * rate, smooth.shape[1])) ** 2
        noise = np.outer(sd**2 * smooth.shape[1], gain)
        power = np.sum(np.where(power > _CLEAR * noise, power, 0.0), axis=0)
        below = int(np.searchsorted(np.cumsum(power), _MOTION * power.sum()))
        highest = 2 * below * rate / smooth.shape[1]
        samples = sum(one.shape[1] for one in self.positions)
        hop = int(min(max(samples / rate / _WINDOWS, _SHORTEST_S), _LONGEST_S) * rate / 2)
        wanted = 2 * int(np.ceil(highest * 2 * hop / rate)) + 1
        count = min(max(wanted, _FEWEST), _MOST, 2 * (hop // 2 - _POWER) - 1)
        return RobotDesign(rate, taps, TestFunctions(count, _POWER, hop, 1 / rate), sd, still)

    def smoothed(self, q: Float, taps: int, order: int) -> Float:
        """Positions or rates [n, samples]; wrong within half of the ends."""
        weights = polynomial_weights(taps, POLYNOMIAL, order) * self.sample_rate**order
        return np.array([filtered(one, weights) for one in q])

    def values(self, columns: Sequence[int], size: int, seed: int | None = None, sign: int = 1) -> Iterator[Segment]:
        """Columns of the torques at the steps of each segment, so many at a time.

        Parameters
        ----------
        seed, sign : of as much noise of the encoders again; None: none is added
        """
        taps = self.design.taps
        random = np.random.default_rng(seed)
        for q, torque in zip(self.positions, self.torques, strict=True):
            if seed is not None:
                q = q + sign * self.design.sd[:, np.newaxis] * random.normal(size=q.shape)
            steps = slice(taps // 2, q.shape[1] - taps // 2)
            if steps.stop - steps.start < 2 * self.design.functions.hop:
                continue
            position, rate = (self.smoothed(q, taps, order)[:, steps] for order in (0, 1))
            yield Segment(self.chain, columns, position, rate, torque[:, steps], size)


def _bending(q: Float, sd: Float) -> tuple[Float, Float]:
    """Frequencies at which some joint moves clear of its noise [rad a sample], and what of the square of each joint's
    acceleration is there, over the square of the frequency [n, frequencies]: the square of the part that an error of
    rates takes of it, by its product with the square of the error."""
    n = q.shape[1]
    window = np.hanning(n)
    power = np.abs(np.fft.rfft((q - q.mean(axis=1, keepdims=True)) * window)) ** 2
    mean = np.array([np.convolve(one, np.ones(_BINS) / _BINS, "same") for one in power])
    power *= mean > _CLEAR * sd[:, np.newaxis] ** 2 * np.sum(window**2)
    w, clear = 2 * math.pi * np.fft.rfftfreq(n), np.any(power, axis=0)
    w, power = w[clear], power[:, clear]
    return np.asarray(w), np.asarray(power * w**2 / np.maximum(power @ w**4, 1e-300)[:, np.newaxis])


def _hidden(s: Float, noise: Float) -> Float:
    """Part of the variance of each parameter that is of directions in which noise of the encoders is most of S [p]."""
    scale = 1 / np.sqrt(np.maximum(np.diag(s), 1e-300))
    sizes, axes = np.linalg.eigh(s * np.outer(scale, scale))
    root = scale[:, np.newaxis] * axes / np.sqrt(np.maximum(sizes, RIDGE))
    parts, directions = np.linalg.eigh(root.T @ noise @ root)
    variances = (root @ directions) ** 2 / np.maximum(np.abs(1 - parts), RIDGE)
    return np.asarray(np.sum(variances[:, parts > _MOST_NOISE], axis=1) / np.sum(variances, axis=1))


def _mean_square(x: Float, where: npt.NDArray[np.bool_]) -> Float:
    """Of each row [n]."""
    return np.asarray(np.sum(x**2 * where, axis=1) / np.sum(where, axis=1))


@dataclass(frozen=True)
class Segment:
    """Steps of a segment: positions, rates and torques [n, steps]; `size` of them are computed at a time."""

    chain: Chain
    columns: Sequence[int]
    position: Float
    rate: Float
    torque: Float
    size: int

    @cached_property
    def entries(self) -> list[tuple[int, int, int]]:
        """(order of the derivative, joint, place in the columns) of each value."""
        others = [(0, joint, place) for place, joint, _ in friction(self.chain, self.columns)]
        return [*self.chain.program(self.columns)[1], *others]

    def pieces(self) -> Iterator[Float]:
        """Values [entries, steps] of one piece after the other."""
        program = self.chain.program(self.columns)[0]
        others = list(friction(self.chain, self.columns))
        steps = self.position.shape[1]
        for first in range(0, steps, self.size):
            own = slice(first, min(first + self.size, steps))
            rate = self.rate[:, own]
            found = evaluated(program, [*self.position[:, own], *rate])
            found += [column(rate[joint]) for _, joint, column in others]
            yield np.array([np.broadcast_to(one, rate.shape[1:]) for one in found])

    def torques(self, p: Float) -> Float:
        """Torques, and momenta, whose slopes are torques too, of parameters [.., p]: [2, n, .., steps]."""
        out = np.zeros((2, len(self.position), *p.shape[:-1], self.position.shape[1]))
        first = 0
        for values in self.pieces():
            own = slice(first, first + values.shape[1])
            for (order, joint, place), one in zip(self.entries, values, strict=True):
                out[order, joint, ..., own] += p[..., place, np.newaxis] * one
            first = own.stop
        return out


def _generalised(wrench: Sequence[Float], turned: Sequence[Float]) -> list[Float]:
    """What a force and a moment in the frame of a free base do along its joints [6, samples], turned by yaw, pitch and
    roll: the force along x, y and z, the moment about the axes of yaw, pitch and roll."""
    yaw, pitch, roll = turned
    (sy, cy), (sp, cp), (sr, cr) = ((np.sin(one), np.cos(one)) for one in (yaw, pitch, roll))
    fx, fy, fz, mx, my, mz = wrench
    down, across = cr * fz + sr * fy, cr * fy - sr * fz  # turned back by roll
    ahead, down = cp * fx + sp * down, cp * down - sp * fx  # and by pitch
    level = cr * my - sr * mz
    return [cy * ahead - sy * across, sy * ahead + cy * across, down, cp * (sr * my + cr * mz) - sp * mx, level, mx]


def _doubts(rate: Float, noise: float, functions: TestFunctions) -> Float:
    """Directions of the test functions that a joint's slow steps reach in each window [windows, K, K], from its rates
    [steps] and their noise; the others are 0."""
    hop, k = functions.hop, functions.count
    slow = np.abs(rate) < max(_SLOW * float(np.sqrt(np.mean(rate**2))), _CLEAR_RATE * noise)
    slow[1:] |= rate[1:] * rate[:-1] <= 0
    chi = np.real(np.exp(1j * np.outer(np.arange(2 * hop) * functions.dt, functions.rates)) @ functions.coefficients)
    root = np.linalg.cholesky(functions.gram(0, 0))
    chi = np.linalg.solve(root, chi.T).T
    out = np.zeros((len(rate) // hop - 1, k, k))
    for window, own in enumerate(out):
        inside = chi[slow[window * hop : (window + 2) * hop]]
        if len(inside):
            sizes, directions = np.linalg.eigh(inside.T @ inside)
            own[:] = root @ (directions * (sizes > _REACHED))
    return out


@dataclass(frozen=True)
class RobotRows:
    """Rows of all windows.

    Attributes
    ----------
    regressors, known : of each joint [n, windows, p, K] and its torque [n, windows, K]
    others : of each law of LAWS, which the equations do not have, and of LATE [laws + 1, n, windows, K]
    doubts : directions that do not count [n, windows, K, ..]
    next : of each window but the last, whether the one behind it overlaps it [windows - 1]
    free : part of the rows that counts, of each joint [n]
    weights : that made the rows white [n, windows, K, K]; None: they are not
    """

    regressors: Float
    known: Float
    others: Float
    doubts: Float
    next: npt.NDArray[np.bool_]
    free: Float
    weights: Float | None = None

    @classmethod
    def of(cls, run: RobotRun, columns: Sequence[int], seed: int | None = None, sign: int = 1) -> RobotRows:
        """Of a run; see RobotRun.values."""
        functions = run.design.functions
        hop, n = functions.hop, len(run.chain.joints)
        # At the peak 4 copies of the regressors, 7 of the doubts, 2 of the laws: on 3, 6 and 7 joints, to 13 %.
        window = 8 * n * functions.count * (4 * len(columns) + 7 * functions.count + 2 * len(LAWS))
        samples, most = sum(one.shape[1] for one in run.positions), int(_MOST_BYTES / window) * hop
        if samples > most:
            raise PvidError(
                f"{samples / run.sample_rate:.0f} s of {n} joints need more than {_MOST_BYTES / 1e9:.3g} GB of memory: "
                f"cut the log to {int(most / run.sample_rate)} s"
            )
        tables = [functions.combine(0), -functions.combine(1)]
        weights = polynomial_weights(run.design.taps, POLYNOMIAL, 1) * run.sample_rate
        noise = run.design.sd * float(np.linalg.norm(weights))
        parts, known, others, doubts, follows = [], [], [], [], []
        for segment in run.values(columns, max(_STEPS // hop, 1) * hop, seed, sign):
            halves = [functions.half_sums(functions.halves(one)) for one in segment.pieces()]
            whole = np.concatenate(halves, axis=1)
            sums = functions.joined(whole[:, :-1], whole[:, 1:])
            own = np.zeros((n, sums.shape[1], len(columns), functions.count))
            for (order, joint, place), one in zip(segment.entries, sums, strict=True):
                own[joint, :, place] += one @ tables[order]
            parts.append(own)
            torques = functions.window_sums(segment.torque)
            known.append(torques @ tables[0])
            laws = [functions.window_sums(of(segment.position, segment.rate)) @ tables[0] for of in LAWS.values()]
            others.append(np.array([*laws, -torques @ tables[1]]))
            doubts.append(np.array([_doubts(*one, functions) for one in zip(segment.rate, noise, strict=True)]))
            doubts[-1][: run.chain.free] = 0.0  # they have no dry friction
            follows += [*([True] * (sums.shape[1] - 1)), False]
        if sum(one.shape[1] for one in parts) < _FEWEST_WINDOWS:
            raise PvidError(
                f"the run has fewer than {_FEWEST_WINDOWS} windows of {functions.length:.3g} s: record longer"
            )
        x, y, away = (np.concatenate(one, axis=1) for one in (parts, known, doubts))
        return cls(x, y, np.concatenate(others, axis=2), away, np.array(follows[:-1], np.bool_), np.ones(n))

    @property
    def windows(self) -> int:
        """Of the run."""
        return len(self.known[0])

    def white(self, roots: Float) -> RobotRows:
        """With unit covariance, from R_i^(-1/2) [n, K, K], but for what is in doubt, which is gone."""
        doubts = np.einsum("iwkd,ijk->iwjd", self.doubts, roots, optimize=True)
        size = np.linalg.norm(doubts, axis=2, keepdims=True)
        doubts = np.divide(doubts, size, out=np.zeros(doubts.shape), where=size > 0)
        left = np.eye(doubts.shape[2]) - doubts @ np.linalg.pinv(doubts, rcond=_DIRECTION)
        roots = left @ roots[:, np.newaxis]
        x = np.einsum("iwpk,iwjk->iwpj", self.regressors, roots, optimize=True)
        y = np.einsum("iwk,iwjk->iwj", self.known, roots)
        free = np.trace(left, axis1=2, axis2=3).mean(axis=1) / doubts.shape[2]
        return RobotRows(x, y, _weighted(self.others, roots), self.doubts, self.next, free, roots)

    def moments(self, windows: slice = slice(None)) -> tuple[Float, Float]:
        """S [p, p] and, of each joint, its part of F [n, p]."""
        x = self.regressors[:, windows].transpose(2, 0, 1, 3)
        flat = x.reshape(len(x), -1)
        return flat @ flat.T, np.einsum("piwk,iwk->ip", x, self.known[:, windows], optimize=True)

    def residuals(self, p: Float) -> Float:
        """[n, windows, K]."""
        return np.asarray(self.known - np.einsum("iwpk,p->iwk", self.regressors, p))

    def scores(self, p: Float) -> Float:
        """What each window has of F - S p [windows, p]."""
        return np.asarray(np.einsum("iwpk,iwk->wp", self.regressors, self.residuals(p), optimize=True))


def _weighted(columns: Float, weights: Float) -> Float:
    """Columns [.., n, windows, K], of white rows."""
    return np.asarray(np.einsum("...iwk,iwjk->...iwj", columns, weights, optimize=True))


@dataclass(frozen=True)
class Lacking:
    """A term that the equations do not have, to first order.

    Attributes
    ----------
    law, joint : name in LAWS, or GAIN, LATE, .., and the joint from 0, or EVERY
    size : of the term [N m or N over the unit of the law; s of LATE; of ZERO that of the position, of SOFT that over
        the torque's; GAIN, LOADED and RATIO are relative]
    t : the size over its standard error when it was added, from the scatter of the windows, at least that of the rows;
        of soft friction that another joint has too, ALIKE times that, and of a gain 1 / ALIKE times
    shift : what p moves by with the term [p]
    """

    law: str
    joint: int
    size: float
    t: float
    shift: Float


@dataclass(frozen=True)
class RobotFit:
    """An estimate.

    Attributes
    ----------
    run, design : what it is from
    columns : places of the parameters among the standard ones
    p, covariance : base parameters, and of their noise [p], [p, p]
    by_gain : what p is off by if the torque of a joint is recorded (1 + g) times as large as it is, over g [n, p]
    uncorrected : p with the noise of the encoders in the regressors [p]
    halves : of the first and of the second half of the windows [2, p]
    apart : their difference over its standard error [p]
    undetermined : a standard error is worth more than a tenth of the torques, or leans on directions that have more
        noise than motion [p]
    windows : of the run
    lacking : terms that the equations may lack, one, two, .. together: each time the surest is added, as the last one
    springs : what a spring of 1 N m/rad or N/m at each joint moves p by [n, p]; 0 where p takes too little of it to
        hide it
    """

    run: RobotRun
    columns: tuple[int, ...]
    p: Float
    covariance: Float
    by_gain: Float
    uncorrected: Float
    halves: Float
    apart: Float
    undetermined: npt.NDArray[np.bool_]
    windows: int
    lacking: tuple[tuple[Lacking, ...], ...]
    springs: Float

    @property
    def design(self) -> RobotDesign:
        """Of the windows."""
        return self.run.design

    def fewest_samples(self, run: RobotRun) -> int:
        """Of a segment of a run whose torques are predicted."""
        return max(2 * run.design.functions.hop, 2 * self.design.taps + 1) + run.design.taps - 1

    def predicted(self, run: RobotRun, p: Float, seed: int | None = None) -> Iterator[tuple[Float, Float]]:
        """Torques of each segment of a run, measured and as each of several p [.., p] gives them: [n, steps] and
        [n, .., steps]; `seed` as of RobotRun.values."""
        taps = 2 * self.design.taps + 1
        weights = polynomial_weights(taps, POLYNOMIAL, 1) * run.sample_rate
        for segment in run.values(self.columns, _STEPS, seed):
            if segment.position.shape[1] < taps:
                continue
            whole = segment.torques(p)
            inner = slice(taps // 2, whole.shape[-1] - taps // 2)
            slopes = np.apply_along_axis(filtered, -1, whole[1], weights)
            yield segment.torque[:, inner], (whole[0] + slopes)[..., inner]


@np.errstate(invalid="ignore")  # what the noise of the encoders covers has no standard error
def identify_robot(model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float) -> RobotFit:
    """Base parameters from a run: name of each signal -> samples [n], in the model's units.

    Raises PvidError when the run is too short.
    """
    whole = RobotRun(model, run, sample_rate)
    for k in range(len(whole.chain.joints)):
        if whole.positions and not any(np.ptp(one[k]) for one in whole.positions):
            raise PvidError(
                f"{whole.chain.position(k)} does not change: move it, or hold it and leave it out of `pvid model from "
                "--joints`"
            )
    columns = tuple(one.standard for one in whole.chain.base)
    rows = RobotRows.of(whole, columns)
    functions = whole.design.functions
    for k, one in enumerate(rows.white(np.array([np.eye(functions.count)] * len(rows.known))).free):
        if one < _DIRECTION:
            raise PvidError(
                f"{whole.chain.position(k)} is nowhere clear of a standstill for a window of {functions.length:.3g} s: "
                "move this joint faster, for longer in one direction, or with an encoder of more bits"
            )
    grams = np.array([functions.gram(m, m) for m in range(3)])
    traces = np.trace(grams, axis1=1, axis2=2)[:, np.newaxis, np.newaxis]
    grams /= traces
    parts = np.array([[np.mean(one**2), 0.0, 0.0] for one in rows.known])
    if idle := whole.idle:
        parts[idle] = _idle_parts(whole, rows, grams)
    for _ in range(_TURNS):
        roots = np.array([_root(one, grams) for one in parts])
        white = rows.white(roots)
        s, f = white.moments()
        free = white.free - np.array(
            [np.sum(inverse(s) * np.einsum("wpk,wqk->pq", one, one, optimize=True)) for one in white.regressors]
        ) / (rows.windows * functions.count)
        left = white.residuals(solved(s, f.sum(axis=0)))
        for k in set(range(len(parts))) - set(idle):
            parts[k] = _fitted(left[k].T @ left[k] / (rows.windows * free[k]), grams, roots[k])
    uncorrected = solved(s, f.sum(axis=0))
    more_s, more_f = np.zeros(s.shape), np.zeros(f.shape)
    drawn = np.zeros((_DRAWS, rows.windows, len(columns)))
    for seed in range(_DRAWS):
        for sign in (1, -1):
            noisy = replace(RobotRows.of(whole, columns, seed, sign), doubts=rows.doubts).white(roots)
            again = noisy.moments()
            more_s += (again[0] - s) / (2 * _DRAWS)
            more_f += (again[1] - f) / (2 * _DRAWS)
            drawn[seed] += noisy.scores(uncorrected) / 2  # of the pair: what is linear in the noise cancels
            del noisy  # its regressors
    drawn -= drawn.mean(axis=0)
    own, before, after = (
        one.reshape(-1, len(columns)) for one in (drawn, drawn[:, :-1][:, white.next], drawn[:, 1:][:, white.next])
    )
    quadratic = (own.T @ own + before.T @ after + after.T @ before) / (_DRAWS - 1)
    corrected = s - more_s
    p = solved(corrected, (f - more_f).sum(axis=0))
    bread = inverse(corrected)
    e = white.residuals(p) / np.sqrt(free)[:, np.newaxis, np.newaxis]
    n, count = len(roots), functions.count
    overlaps = np.array([functions.overlap(m, m) for m in range(3)]) / traces
    later = np.zeros((n, count, n, count))
    for k, (part, root) in enumerate(zip(parts, roots, strict=True)):
        later[k, :, k] = root @ np.tensordot(part, overlaps, 1) @ root.T
    flat = e.transpose(1, 0, 2).reshape(rows.windows, n * count)
    first, second = flat[:-1][white.next], flat[1:][white.next]
    seen = _scatter(white, flat.T @ flat / len(flat), first.T @ second / max(len(first), 1))
    covariance = bread @ (seen + (1 + 1 / _DRAWS) * quadratic) @ bread
    wanted = np.diag(bread @ _scatter(white, np.eye(n * count), later.reshape(n * count, -1)) @ bread)
    wider = np.sqrt(np.maximum(wanted / np.diag(covariance), 1.0))
    covariance = covariance * np.outer(wider, wider)
    by_gain = (f - more_f) @ bread
    size = np.sqrt(np.diag(covariance) * np.diag(s))
    balanced = np.sum(white.regressors[idle] ** 2, axis=(0, 1, 3)) * p**2  # what cancels where no torque is
    undetermined = ~(size < _COVERED * np.sqrt(np.sum(white.known**2) + np.sum(balanced)))
    undetermined |= _hidden(s, more_s) > _LEANS
    middle = rows.windows // 2
    halves, variances = [], []
    for part in (slice(0, middle), slice(middle, None)):
        own_s, own_f = white.moments(part)
        share = (middle if part.stop else rows.windows - middle) / rows.windows
        own_s = own_s - share * more_s
        halves.append(solved(own_s, (own_f - share * more_f).sum(axis=0)))
        variances.append(np.diag(inverse(own_s)) * np.diag(covariance) / np.diag(bread))
    apart = np.abs(halves[0] - halves[1]) / np.sqrt(np.sum(variances, axis=0))
    return RobotFit(
        whole, columns, p, covariance, by_gain, uncorrected, np.array(halves), apart, undetermined, rows.windows,
        tuple(_lacking(whole, white, columns, p, bread)), _springs(white, bread),
    )  # fmt: skip


def _springs(white: RobotRows, bread: Float) -> Float:
    """See RobotFit."""
    columns = white.others[list(LAWS).index("q")]
    sides = np.einsum("iwpk,iwk->ip", white.regressors, columns, optimize=True)
    moved = sides @ bread
    taken = np.sum(sides * moved, axis=1) / np.sum(columns**2, axis=(1, 2))
    return np.asarray(np.where(taken[:, np.newaxis] > _HIDDEN, moved, 0.0))


def _lacking(
    whole: RobotRun, white: RobotRows, columns: Sequence[int], p: Float, bread: Float
) -> Iterator[tuple[Lacking, ...]]:
    """Scores of the laws in the residuals of p, and beside those that were surest before.

    Parameters
    ----------
    columns : of the regressors, as of RobotFit
    bread : (X^T X)^-1, the noise of the encoders taken off
    """
    e, terms = white.residuals(p), terms_of(whole.chain)
    effects = dict(zip(_PREDICTED, _predicted(whole, white, columns, p), strict=True))
    rows = np.zeros((len(terms), *e.shape))
    for row, (law, joint) in zip(rows, terms, strict=True):
        if law in effects:
            row[:] = effects[law][joint]
            continue
        of = slice(None) if joint == EVERY else joint
        row[of] = (white.known - e if law == GAIN else white.others[[*LAWS, LATE].index(law)])[of]
    flat, own = rows.reshape(len(terms), -1), white.regressors.transpose(2, 0, 1, 3).reshape(len(p), -1)
    mixed = flat @ own.T @ bread
    rests = rows - (mixed @ own).reshape(rows.shape)
    products = rests.reshape(len(terms), -1) @ flat.T
    gains, power = np.tensordot(rows, e, 3), np.sum(rows**2, axis=(1, 2, 3))
    free = np.diag(products) > _DIRECTION * power
    taken = np.any(rows, axis=(2, 3)) @ np.sum(white.known**2, axis=(1, 2))
    most = _most(whole.chain, terms, np.sqrt(taken / power))
    chosen: list[int] = []
    sure: list[float] = []
    while len(chosen) < max(_TERMS, len(e)):
        best = (0.0, -1)
        for k in np.flatnonzero(free):
            together = [*chosen, int(k)]
            inner = products[np.ix_(together, together)]
            beside = np.linalg.solve(inner[:-1, :-1], inner[:-1, -1])
            left = float(inner[-1, -1] - inner[-1, :-1] @ beside)
            if k in chosen or left <= _DIRECTION * inner[-1, -1]:
                continue  # the parameters have it, or the others
            sizes = np.linalg.solve(inner, gains[together])
            if abs(sizes[-1]) > most[k] or (terms[k][0] in _POSITIVE and sizes[-1] < 0):
                continue
            rest = rests[k] - np.tensordot(beside, rests[chosen], 1)
            scores = np.sum(rest * (e - np.tensordot(sizes, rests[together], 1)), axis=(0, 2))
            twice = 2 * float(np.sum((scores[:-1] * scores[1:])[white.next]))
            t = float(sizes[-1]) * left / math.sqrt(max(np.sum(scores**2) + max(twice, 0.0), left))
            alike = terms[k][0] == "slow" and any(terms[one][0] == "slow" for one in chosen)
            best = max(best, (abs(t) * (ALIKE if alike else 1.0), int(k)))
        if best[1] < 0:
            return
        chosen.append(best[1])
        sure.append(best[0] / (ALIKE if terms[best[1]][0] == GAIN else 1.0))
        sizes = np.linalg.solve(products[np.ix_(chosen, chosen)], gains[chosen])
        yield tuple(
            Lacking(*terms[k], float(size), t, -size * mixed[k]) for k, size, t in zip(chosen, sizes, sure, strict=True)
        )


def _most(chain: Chain, terms: Sequence[tuple[str, int]], whole: Float) -> Float:
    """Sizes up to which terms are to first order [terms]; `whole`: those that make as much as the torques."""
    return np.array([
        math.inf if law in LAWS or law == GAIN
        else _FIRST if law in (LOADED, RATIO) or (law == ZERO and not chain.joints[joint].prismatic)
        else _FIRST * size
        for (law, joint), size in zip(terms, whole, strict=True)
    ])  # fmt: skip


def _predicted(whole: RobotRun, white: RobotRows, columns: Sequence[int], p: Float) -> Float:
    """White rows, for the parameters p, of each law of _PREDICTED at each joint, to first order
    [laws, n, n, windows, K]."""
    from scipy.interpolate import CubicSpline  # a quarter of a second

    functions, n = whole.design.functions, len(whole.chain.joints)
    tables, rubbing = [functions.combine(0), -functions.combine(1)], list(friction(whole.chain, columns))
    bodies = p.copy()
    bodies[[place for place, _, _ in rubbing]] = 0.0
    parts = []
    for segment in whole.values(columns, _STEPS):
        steps = segment.position.shape[1]
        thin = np.linspace(0, steps - 1, -(-steps * _THINNED // max(whole.design.taps, _THINNED))).astype(int)
        t, every = thin / whole.sample_rate, np.arange(steps) / whole.sample_rate
        q, v = segment.position[:, thin], segment.rate[:, thin]
        given = replace(segment, position=q, rate=v).torques(bodies)
        loads = CubicSpline(t, given[0] + CubicSpline(t, given[1], axis=1)(t, 1), axis=1)
        load, slope, torque = loads(t), loads(t, 1), loads(every)
        loaded = np.abs(torque) * np.sign(segment.rate)
        for place, joint, column in rubbing:
            torque[joint] += p[place] * column(segment.rate[joint])
        own = np.zeros((len(_PREDICTED), n, n, steps // functions.hop - 1, functions.count))
        for k in range(whole.chain.free, n):
            for law, one in enumerate((loaded[k], -np.sign(torque[k]))):
                own[law, k, k] = functions.window_sums(one) @ tables[0]
            small = _SMALL * np.eye(n)[k][:, np.newaxis]
            near = (replace(segment, position=q + small, rate=v), replace(segment, position=q, rate=v + small))
            by_q, by_v = ((one.torques(bodies) - given) / _SMALL for one in near)
            for law, one in enumerate((by_q, q[k] * by_q + v[k] * by_v, load[k] * by_q + slope[k] * by_v), 2):
                sums = functions.window_sums(CubicSpline(t, one, axis=2)(every))
                own[law, k] = -sum(it @ table for it, table in zip(sums, tables, strict=True))
        parts.append(own)
    assert white.weights is not None
    return _weighted(np.concatenate(parts, axis=3), white.weights)


def _idle_parts(whole: RobotRun, rows: RobotRows, grams: Float) -> Float:
    """Covariance of the rows of joints that nothing drives [idle, 3], from the noise of the encoders alone, with the
    parameters of the file: their residuals are least where all parameters are 0."""
    chain = whole.chain
    given = [chain.of_file(one) for one in chain.base]
    friction_only = {"Fv", "Fc", "Offset"}
    unknown = [chain.name_of(base) for base, one in zip(chain.base, given, strict=True)
               if one is None and chain.standard[base.standard].kind not in friction_only]  # fmt: skip
    if unknown:
        raise PvidError(
            f"where nothing drives {chain.force(whole.idle[0])} values are needed to begin with, "
            f"for {', '.join(unknown)}: give every joint its inertial"
        )
    again = RobotRows.of(whole, tuple(one.standard for one in chain.base), 0)
    noise = np.einsum("iwpk,p->iwk", (again.regressors - rows.regressors)[whole.idle], [one or 0.0 for one in given])
    root = np.eye(rows.known.shape[2])
    return np.array([_fitted(one.T @ one / rows.windows, grams, root) for one in noise])


def _root(parts: Float, grams: Float) -> Float:
    """R^(-1/2) of R = sum_m s_m gram_m [K, K]."""
    whole = np.tensordot(parts, grams, 1)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(whole + _RIDGE * np.diag(np.diag(whole)))))


def _fitted(scatter: Float, grams: Float, root: Float) -> Float:
    """s_m >= 0 with sum_m s_m gram_m closest to the scatter of whitened residuals [K, K]."""
    from scipy.optimize import nnls  # a quarter of a second

    sides = np.array([one.reshape(-1) for one in (scatter, *(root @ one @ root.T for one in grams))])
    sizes = np.linalg.norm(sides[1:], axis=1)
    return np.asarray(nnls((sides[1:] / sizes[:, np.newaxis]).T, sides[0])[0] / sizes)


def _scatter(white: RobotRows, own: Float, later: Float) -> Float:
    """Covariance of the score sum X^T e [p, p], from those of the residuals of all joints in a window, and with those
    in the next, which all windows have in common [n K, n K]."""
    x = white.regressors.transpose(1, 2, 0, 3).reshape(white.windows, white.regressors.shape[2], len(own))
    total = np.einsum("wpk,wqk->pq", x @ own, x, optimize=True)
    neighbours = np.einsum("wpk,wqk->pq", x[:-1][white.next] @ later, x[1:][white.next], optimize=True)
    return np.asarray(total + neighbours + neighbours.T)
