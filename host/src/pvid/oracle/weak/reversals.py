"""sgn(v) for sums: when v changes its sign, and which values at the steps give the exact integral.

A plain sum of sgn(v_k) misplaces each reversal by up to a step. Here each reversal is located (the zero of v between
two steps, refined by a parabola of the position that may have another curvature before and after), and the four steps
around it get the values with which the sum equals the integral of sgn(v) g(t) for every cubic g.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

# The sign is in doubt where the velocity is below so many standard deviations of its noise, plus its blur.
_NOISES = 3.0

# A located time may be off by this much [steps], and by this part of the time the sign is in doubt, for what the
# parabola leaves out.
_FLOOR = 0.3
_DOUBT = 0.15


@dataclass(frozen=True)
class Signs:
    """sgn(v) at the steps.

    Attributes
    ----------
    values : with the corrected steps around each reversal; from one sign to the other where it is in doubt for long [n]
    times : places at which the integral of the sign is in doubt: reversals, near misses, pieces of sticking [steps]
    variances : of the times of reversals, or what has the same effect [steps^2]
    reversals : how many of the times are such
    stuck : steps at which the sign stays in doubt for longer than a piece [n]
    slopes : d values / d v of a soft sign, for the noise of v [n]
    limit : of |v|, up to which an averaged sign is in doubt
    """

    values: Float
    times: Float
    variances: Float
    reversals: int
    stuck: npt.NDArray[np.bool_]
    slopes: Float
    limit: float = 0.0


def joined(signs: Sequence[Signs], sizes: Sequence[int]) -> Signs:
    """Of segments, one behind the other, of which so many steps are kept."""
    if len(signs) == 1:
        return signs[0]
    firsts = np.cumsum([0, *sizes[:-1]])
    kept = [one.times < size for one, size in zip(signs, sizes, strict=True)]
    return Signs(
        np.concatenate([one.values[:size] for one, size in zip(signs, sizes, strict=True)]),
        np.concatenate([one.times[use] + first for one, use, first in zip(signs, kept, firsts, strict=True)]),
        np.concatenate([one.variances[use] for one, use in zip(signs, kept, strict=True)]),
        sum(one.reversals for one in signs),
        np.concatenate([one.stuck[:size] for one, size in zip(signs, sizes, strict=True)]),
        np.concatenate([one.slopes[:size] for one, size in zip(signs, sizes, strict=True)]),
        max(one.limit for one in signs),
    )


def soft(v: Float, width: float) -> Signs:
    """tanh(v / width)."""
    none, values = np.zeros(0), np.tanh(v / width)
    return Signs(values, none, none, 0, np.zeros(v.shape, bool), (1 - values**2) / width)


def averaged(v: Float, sd_v: float, blur: Float) -> Signs:
    """Mean of sgn over each step, v linear there, and the steps at which the sign is in doubt: `stuck`."""
    none = np.zeros(0)
    values = np.clip(2 * v / (np.abs(np.gradient(v)) + 1e-300), -1, 1)
    limit = _NOISES * sd_v + float(blur.max(initial=0.0))
    return Signs(values, none, none, 0, np.abs(v) <= limit, np.zeros(v.shape), limit)


def correction(f: Float) -> Float:
    """Values [..., 4] that steps k - 1..k + 2 need on top of sgn = -1 up to k and +1 from k + 1, reversal at k + f.

    By Euler-Maclaurin the plain sum of -g up to k and +g from k + 1 is the integral but for terms in g, g', g''' at k
    and k + 1; what is missing is matched for 1, t, t^2, t^3.
    """
    f = np.asarray(f, np.float64)[..., np.newaxis]
    j = np.arange(4)
    integral = (1 - 2 * f ** (j + 1)) / (j + 1)
    at_k = np.array([0.5, 1 / 12, 0.0, -6 / 720])
    at_next = np.array([-0.5, -0.5 + 1 / 12, -0.5 + 2 / 12, -0.5 + 3 / 12 - 6 / 720])
    moments = integral + at_k + at_next
    powers = np.vander(np.arange(-1.0, 3.0), 4, increasing=True).T  # [moment, step]
    return np.asarray(np.linalg.solve(powers, moments[..., np.newaxis])[..., 0])


def in_doubt(v: Float, threshold: Float) -> npt.NDArray[np.int64]:
    """First step and first step behind of each stretch with |v| <= threshold, or of no step between opposite signs."""
    low = (np.abs(v) <= threshold).astype(np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low, [0]])))
    jumps = np.flatnonzero((v[1:] * v[:-1] < 0) & (low[1:] == 0) & (low[:-1] == 0)) + 1
    stretches = np.concatenate([edges.reshape(-1, 2), np.stack([jumps, jumps], axis=1)])
    return stretches[np.argsort(stretches[:, 0], kind="stable")]


def zeros_between(v: Float, first: npt.NDArray[np.int64], behind: npt.NDArray[np.int64]) -> Float:
    """Zeros [steps] of the straight lines through v from the step before each `first` to its `behind` [stretches]."""
    out, gaps = np.zeros(len(first)), behind - first + 1
    for gap in np.unique(gaps).tolist():
        own = np.flatnonzero(gaps == gap)
        x = v[first[own, np.newaxis] - 1 + np.arange(gap + 1)]
        slope = x @ (np.arange(gap + 1) - gap / 2) / (gap * (gap + 1) * (gap + 2) / 12)
        rises = slope * (x[:, -1] - x[:, 0]) > 0
        out[own] = gap / 2 - np.where(rises, np.mean(x, axis=1) / np.where(rises, slope, 1.0), 0.0)
        out[own] = first[own] - 1 + np.clip(out[own], 0, gap)
    return out


def _counted(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """0, 1, ... up to each of the counts, one behind the other."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def refined(position: Float, start: Float, half: int, sd: float) -> tuple[Float, Float]:
    """Times of reversals [samples] and their variances, from the position's own samples.

    Around t0 the position is c + j s^3/6 + a s^2/2 with one a before and another after t0 (s = t - t0): Coulomb
    friction changes the acceleration. Gauss-Newton on t0, c, both a and j. Where it fails the start is kept.

    Parameters
    ----------
    position : raw samples [n]
    start : times [samples]
    half : samples before and after
    sd : of the position's noise
    """
    n = len(position)
    centre = np.clip(np.round(start).astype(np.int64), half, n - half - 1)
    places = centre[:, np.newaxis] + np.arange(-half, half + 1)
    x = position[places] - position[centre][:, np.newaxis]
    t0 = start.copy()
    scale = float(half)
    information = np.ones(len(start))
    for _ in range(6):
        s = (places - t0[:, np.newaxis]) / scale
        before, after = np.where(s < 0, s**2 / 2, 0.0), np.where(s >= 0, s**2 / 2, 0.0)
        shape = np.stack([np.ones_like(s), before, after, s**3 / 6], axis=-1)
        q, r = np.linalg.qr(shape)
        inner = np.einsum("ejk,ej->ek", q, x)
        c = np.linalg.solve(r + 1e-9 * np.eye(4), inner[..., np.newaxis])[..., 0]
        residual = x - np.einsum("ejk,ek->ej", q, inner)
        slope = -(np.where(s < 0, c[:, 1:2], c[:, 2:3]) * s + c[:, 3:4] * s**2 / 2) / scale
        slope = slope - np.einsum("ejk,ek->ej", q, np.einsum("ejk,ej->ek", q, slope))
        information = np.maximum(np.sum(slope**2, axis=1), 1e-300)
        step = np.sum(slope * residual, axis=1) / information
        t0 = t0 + np.clip(step, -half / 4, half / 4)
    noise = np.maximum(np.sum(residual**2, axis=1) / (2 * half + 1 - 5), sd**2)
    good = np.isfinite(t0) & (np.abs(t0 - start) < half / 2) & (c[:, 1] * c[:, 2] > 0)
    return np.where(good, t0, start), np.where(good, noise / information, np.nan)


@dataclass(frozen=True)
class Position:
    """The position whose derivative a velocity is.

    Attributes
    ----------
    samples : raw [n]
    places : sample of each step
    half : samples before and after a reversal that its parabola takes
    sd : of a sample's noise
    known : time of a reversal and its variance, by where the search for it began [samples]
    """

    samples: Float
    places: npt.NDArray[np.int64]
    half: int
    sd: float
    known: dict[float, tuple[float, float]] = field(default_factory=dict)

    def refined(self, start: Float) -> tuple[Float, Float]:
        """See `refined`; of each start once."""
        new = [one for one in dict.fromkeys(start.tolist()) if one not in self.known]
        if new:
            times, variances = refined(self.samples, np.array(new), self.half, self.sd)
            self.known.update(zip(new, zip(times.tolist(), variances.tolist(), strict=True), strict=True))
        found = np.array([self.known.get(one, (one, np.nan)) for one in start.tolist()]).reshape(-1, 2)
        return found[:, 0], found[:, 1]


def located(v: Float, sd_v: float, blur: Float, piece: int, position: Position | None = None) -> Signs:
    """Signs with every reversal located, and what stays in doubt.

    In a long stretch in doubt the sign goes straight from that before to that after: its mean where it may switch at
    any time.

    Parameters
    ----------
    v : velocity at the steps [n]
    sd_v : standard deviation of its noise
    blur : how far its smoothing may be off [n]
    piece : a stretch in doubt that is longer [steps] is cut into pieces; a test function hardly changes within one
    position : None: reversals are zeros of v
    """
    first, behind = in_doubt(v, _NOISES * sd_v + blur).T
    values, stuck, n = np.sign(v), np.zeros(v.shape, bool), len(v)
    length = behind - first
    before = np.where(first > 0, values[first - 1], 0.0)
    after = np.where(behind < n, values[np.minimum(behind, n - 1)], 0.0)
    long = (length > piece) | (before * after == 0)
    turning = ~long & (before != after)
    count = np.where(long, -(-length // piece), 1)
    of = np.repeat(np.arange(len(count)), count)  # stretch of each time
    t = first[of] + (_counted(count) + 0.5) * length[of] / count[of] - 0.5
    t[turning[of]] = zeros_between(v, first[turning], behind[turning])
    # The pieces err together: their variances sum up to that of the whole stretch.
    span = length[of] / np.sqrt(count[of]) + turning[of]
    up = np.where(turning, after, 0.0)[of]
    of = np.repeat(np.arange(len(length)), length)  # stretch of each step in doubt
    place = first[of] + _counted(length)
    rise = np.where(long, after - before, 0.0)[of] * (_counted(length) + 0.5) / length[of]
    values[place] = np.where(turning, 0.0, before)[of] + rise
    stuck[place] = long[of]
    # A sign anywhere in -1..1 over L steps is as a reversal with a standard deviation of L / sqrt(12).
    variances = span**2 / 12
    turns = np.flatnonzero(up)
    if len(turns):
        slope = np.abs(
            v[np.minimum(np.ceil(t[turns] + span[turns] / 2).astype(int), n - 1)]
            - v[np.maximum(np.floor(t[turns] - span[turns] / 2).astype(int), 0)]
        ) / (span[turns] + 1)
        variances[turns] = (sd_v / np.maximum(slope, 1e-300)) ** 2
        if position is not None:
            stride = float(position.places[1] - position.places[0])
            start = position.places[0] + t[turns] * stride
            raw, spread = position.refined(start)
            better = np.isfinite(spread) & (np.abs(raw - start) < (span[turns] + 2) * stride)
            t[turns] = np.where(better, (raw - position.places[0]) / stride, t[turns])
            variances[turns] = np.where(better, spread / stride**2, variances[turns] + span[turns] ** 2 / 12)
        variances[turns] += _FLOOR**2 + (_DOUBT * span[turns]) ** 2
    _turn(values, stuck, t[turns], span[turns], up[turns])
    return Signs(values, t, variances, len(turns), stuck, np.zeros(n))


def _turn(values: Float, stuck: npt.NDArray[np.bool_], t: Float, span: Float, up: Float) -> None:
    """Writes the signs around reversals, one after the other: a later one that is near replaces an earlier one.

    Parameters
    ----------
    values : 0 where a reversal gives the sign [n]; in place
    t, span, up : time of each reversal, how long its sign is in doubt [steps], and the sign behind it
    """
    n, turns = len(values), np.arange(len(t))
    low = np.maximum((t - span).astype(np.int64) - 2, 0)
    width = np.maximum(np.minimum((t + span).astype(np.int64) + 3, n) - low, 0)
    turn = np.repeat(turns, width)
    step = low[turn] + _counted(width)
    first, last = np.zeros((2, n), np.int64) - 1
    first[step[::-1]] = turn[::-1]
    written = (np.abs(step - t[turn]) <= span[turn]) | ((values[step] == 0) & (first[step] == turn))
    written &= ~stuck[step]
    last[step[written]] = turn[written]
    own = np.flatnonzero(last >= 0)
    values[own] = np.where(own <= t[last[own]], -up[last[own]], up[last[own]])
    at = np.floor(t).astype(np.int64)
    inside = (at >= 1) & (at < n - 2)
    near = at[inside, np.newaxis] + np.arange(-1, 3)
    corrected = up[inside, np.newaxis] * correction(t[inside] % 1.0)
    kept = turns[inside, np.newaxis] >= last[near]
    np.add.at(values, near[kept], corrected[kept])
