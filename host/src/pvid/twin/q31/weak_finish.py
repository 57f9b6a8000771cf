"""Twin of weak_finish_q31.c: a window of the weak engine to rows, to steps of p, to the published estimate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.weak import WeakKind
from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.play import Work
from pvid.twin.q31 import weak_noise, weak_white
from pvid.twin.q31.estimator import ROW_LIMIT, EstimatorQ31
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import WIDE, Int, clamp, integers, round_shift, times_q31
from pvid.twin.q31.scaled import Scaled, scaled
from pvid.twin.q31.trust import TrustQ31
from pvid.twin.q31.weak_collect import Schedule
from pvid.twin.q31.weak_error import NOTHING_LOST, OwnError
from pvid.twin.q31.weak_scores import Scores
from pvid.twin.record import Mask, of_all_lanes

_ENTRIES_PER_STAGE = 4
_HARMONICS_PER_STAGE = 2
_ROOTS_PER_STAGE = 4
_UNITS_PER_STAGE = 4
_RESIDUALS_PER_STAGE = 4
_SHARES_PER_STAGE = 1
_FORMATS_PER_STAGE = 2
_CLUSTERS_PER_STAGE = 2
_NOISE_WINDOWS = 16
_END_PARTS = 2
_VARIANCE_RATIO_BITS = 24
_SMALL_STEP = 2**15
_MOST = 2**31 - 1


def _parts(count: int, few: int) -> int:
    return max(-(-count // few), 1)


def _noise_stages(design: WeakDesignQ31) -> int:
    """Of a kind, where the noise is computed anew."""
    harmonics = design.highest + 1
    return design.power + _parts(harmonics, _SHARES_PER_STAGE) + 2 + len(design.noise)


def _white_stages(design: WeakDesignQ31) -> int:
    """Of a kind, likewise."""
    harmonics = design.highest + 1
    return (
        _parts(len(design.noise), _ENTRIES_PER_STAGE)
        + _parts(harmonics, _HARMONICS_PER_STAGE)
        + _parts(harmonics, _ROOTS_PER_STAGE)
        + design.power
    )


def _stages_before_gate(design: WeakDesignQ31, kind: WeakKind, live: int = 0) -> int:
    """From the columns' units up to the residuals, these included."""
    harmonics = design.highest + 1
    project = sum(kind.columns - i for i in range(kind.nuisances)) or 1
    return (
        _parts(harmonics, _UNITS_PER_STAGE)
        + harmonics
        + kind.columns
        + project
        + _parts(kind.thetas + 1, _FORMATS_PER_STAGE)
        + _parts(design.functions - live, _RESIDUALS_PER_STAGE)
    )


def _stages_of_kind(design: WeakDesignQ31, kind: WeakKind, uses_noise: bool) -> int:
    noise = _noise_stages(design) if uses_noise else 0
    return _white_stages(design) + _stages_before_gate(design, kind) + _END_PARTS + design.functions + noise + 1


def shares_place(design: WeakDesignQ31) -> bool:
    """Whether all columns of a window are formed before the next half's first block, at one stage a tick."""
    *before, _ = design.model.kind
    stages = sum(_stages_of_kind(design, kind, True) for kind in before) + _white_stages(design)
    harmonics = design.highest + 1
    return stages + _parts(harmonics, _UNITS_PER_STAGE) + harmonics <= Schedule.of(design).ticks_behind_join


def number_of_stages(design: WeakDesignQ31, iterations: int, estimator: EstimatorQ31, uses_noise: bool) -> int:
    """Of a window, at most."""
    rows = sum(_stages_of_kind(design, kind, uses_noise) for kind in design.model.kind)
    solves = estimator.solve_stages(True) + (iterations - 1) * estimator.solve_stages(False)
    return rows + solves + estimator.assessment_stages + 2 + _parts(estimator.model.n_p, _CLUSTERS_PER_STAGE)


def _rows(made: weak_white.Columns, first: int, n_bits: Sequence[int], y_bits: int) -> tuple[Int, Int]:
    """N of the kind [K, thetas, lanes], and Y [K, lanes]."""
    thetas = len(made.x) - 1

    def entries(place: int, bits: int) -> Int:
        shift = np.broadcast_to(-(made.exponent[place] + bits), made.x[place].shape)
        return clamp(round_shift(made.x[place], np.clip(shift, 0, 63)) << np.clip(-shift, 0, 31), _MOST)

    n = np.stack([entries(j, n_bits[first + j]) for j in range(thetas)], axis=1)
    return n, entries(thetas, y_bits)


def _of_all_lanes(live: Int) -> int:
    if (live != live[0]).any():
        raise PvidError("lanes of one twin must leave out the same nuisances: their estimates differ too much")
    return int(live[0])


def _ratio(rss: Int, freedom: Int, expected: Scaled) -> Scaled:
    return scaled(rss, 0).over(scaled(freedom, 0).times(expected))


def _of_kind(pull: Sequence[Scaled], own: slice, used: Mask) -> Scaled:
    """What the noise takes from b of a kind [n_theta, lanes]; nothing of other kinds and in lanes without rows."""
    places = range(own.start, own.stop)
    m = [np.where(used, one.m, 0) if j in places else np.zeros_like(one.m) for j, one in enumerate(pull)]
    return Scaled(np.stack(m), np.stack([one.e if j in places else np.zeros_like(one.e) for j, one in enumerate(pull)]))


class NoiseOfWindows:
    """When the noise is computed anew, and what was found."""

    def __init__(self, design: WeakDesignQ31, estimator: EstimatorQ31, compensation: bool) -> None:
        self.known = weak_noise.Known(estimator)
        self.is_used = weak_noise.is_used(design, estimator.noise_margin, compensation)
        self.compensates = compensation and bool(design.noise)
        self.size = np.zeros(estimator.lanes, np.int64)  # of the last step
        self.white: dict[int, weak_white.White] = {}  # of each kind
        self.errors = [OwnError(one, estimator.lanes) for one in design.error_variance]
        self.left = np.full(estimator.lanes, NOTHING_LOST)  # of the older rows' information, behind a window
        self._age = _NOISE_WINDOWS

    def begin(self) -> bool:
        """A window; whether it and what whitens it are computed in it."""
        large = of_all_lanes(self.size > _SMALL_STEP)
        renewed = self._age >= _NOISE_WINDOWS or large
        self._age = 1 if renewed else self._age + 1
        return renewed

    def next_fade_factor(self, trust: TrustQ31) -> Int:
        """On the sums before a window's rows [lanes]; 0: none."""
        factor, left = trust.next_fade_factor(), self.left
        self.left = np.full_like(left, NOTHING_LOST)
        return np.where(left < NOTHING_LOST, np.maximum(times_q31(factor, left), 1), factor)

    def take_residuals(self, kind: int, asked: Mask, residual: Scaled) -> None:
        """Of a window's rows, in the lanes asked: mean square over its expectation [lanes]."""
        if self.is_used and len(self.errors) > 1 and of_all_lanes(self.errors[kind].take(asked, residual)):
            self._age = _NOISE_WINDOWS

    def explain(self, kind: int, first: int, theta: Scaled, formats: tuple[Sequence[int], int], gate: GateQ31) -> None:
        """What the sensors explain of a kind's rows; a variance of its own error that does not fit them is changed."""
        before = self.errors[kind].variance
        white = self.white[kind]
        left = self.known.take(white, white.design, kind, first, theta, formats, self.errors[kind])
        gate.begin_anew(left < NOTHING_LOST)
        self.left = np.minimum(self.left, left)
        after = self.errors[kind].variance
        if of_all_lanes((after.m != before.m) | (after.e != before.e)):
            self._age = _NOISE_WINDOWS


def _begin_anew(trust: TrustQ31, scores: Scores) -> None:
    """The rows so far count no more."""
    trust.begin_anew()
    scores.begin_anew()


def _take_noise(
    noise: NoiseOfWindows,
    renewed: bool,
    place: int,
    first: int,
    theta: Scaled,
    formats: tuple[Sequence[int], int],
    gate: GateQ31,
) -> Work:
    """Of a kind, behind its rows, where it is computed anew."""
    if renewed and noise.is_used:
        design = noise.white[place].design
        if not place:
            noise.known.begin(design)
        noise.explain(place, first, theta, formats, gate)
        for _ in range(_noise_stages(design)):
            yield None


def stages(
    window: Int,
    design: WeakDesignQ31,
    iterations: int,
    estimator: EstimatorQ31,
    trust: TrustQ31,
    gates: Sequence[GateQ31],
    formats: tuple[Sequence[int], int],
    noise: NoiseOfWindows,
    scores: Scores,
) -> Work:
    """Processes a window, S_h [channels, H + 1, 2]; yields the reason to report [lanes], or None, after each stage.

    formats : n_bits, y_bits
    """
    if scores.alone:
        scores.skip()
    scores.alone = False
    lanes = estimator.lanes
    expected = scaled(estimator.row_sd * estimator.row_sd, -16)
    sums = np.broadcast_to(window, (lanes, *window.shape))
    renewed, known = noise.begin(), noise.known
    used, first = 0, 0
    free = np.zeros(lanes, np.int64)
    for place, kind in enumerate(design.model.kind):
        own = slice(first, first + kind.thetas)
        theta = scaled(estimator.theta[own], -integers(estimator.theta_bits[own])[:, np.newaxis])
        if renewed:
            noise.white[place] = weak_white.white(design, place, theta, noise.errors[place].variance)
            for _ in range(_white_stages(design)):
                yield None
        white = noise.white[place]
        made = weak_white.columns(white, place, sums)
        n, y = _rows(made, first, *formats)
        live = _of_all_lanes(made.live)
        freedom = np.full(lanes, max(design.functions - live, 1))
        saturated = np.zeros(lanes, np.bool_)
        rss = np.zeros(lanes, np.int64)
        innovations = {}
        for k in range(live, design.functions):
            e, fits = estimator.innovation(n[k], y[k], place)
            innovations[k] = clamp(e, ROW_LIMIT)
            saturated = saturated | ~fits
            rss = clamp(rss + innovations[k] * innovations[k], WIDE)
        for _ in range(_stages_before_gate(design, kind, live) - 1):
            yield None
        gate, residual = gates[place], _ratio(rss, freedom, expected)
        if gate.is_on:
            passes, opens = gate.judge(residual, ~saturated)
            if not of_all_lanes(passes):
                estimator.counters["rejected_outlier"] += 1
                yield np.full(lanes, Reason.REJECTED_OUTLIER, np.uint8)
                yield from _take_noise(noise, renewed, place, first, theta, formats, gate)
                first += kind.thetas
                continue
            if of_all_lanes(opens):
                _begin_anew(trust, scores)
        noise.take_residuals(place, trust.arrived & ~saturated, residual)
        yield None
        if used:
            yield None
        else:
            yield from estimator.fade(noise.next_fade_factor(trust))
        for k in range(live, design.functions):
            added = estimator.take_row(n[k], innovations[k], ~saturated, place)
            yield None if (added == Reason.ACCUMULATED).all() else added
        yield from _take_noise(noise, renewed, place, first, theta, formats, gate)
        first += kind.thetas
        if noise.compensates:
            estimator.add_to_b(_of_kind(known.pull, own, ~saturated))
        yield None
        used += 1
        free = free + freedom
    if not used:
        scores.skip()
        return
    sensors = known.expected(expected, len(design.model.kind))
    estimator.set_expected(sensors)
    reason = np.full(lanes, Reason.ACCUMULATED, np.uint8)
    for iteration in range(trust.steps(iterations)):
        fallback = trust.fallback if iteration == 0 else None
        for solved in estimator.solve(ends_group=iteration == 0, fallback=fallback):
            yield None
            if solved is not None:
                reason = solved
        if not estimator.was_due:
            break
    size = noise.size = estimator.size
    ratio = _ratio(estimator.group_rss, free, sensors).fixed(_VARIANCE_RATIO_BITS)
    scores.add(estimator, ratio)
    for _ in range(1 + estimator.assessment_stages + _parts(estimator.model.n_p, _CLUSTERS_PER_STAGE)):
        yield None
    candidate, above_noise = estimator.judged()
    if estimator.was_due:
        rows = estimator.divider * sum(design.functions - kind.nuisances for kind in design.model.kind)
        scores.widen(candidate, estimator, rows)
    reported = trust.judge(reason, size, above_noise, ratio, candidate)
    if of_all_lanes(noise.left < NOTHING_LOST):
        _begin_anew(trust, scores)
    yield reported
