"""Twin of weak/finish_f32.c: a complete window becomes rows and steps, one stage a tick."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.f32 import WeakTables
from pvid.twin.f32 import weak_whiten
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.trust import Trust
from pvid.twin.f32.weak_window import Window
from pvid.twin.kapitza.full_angle import Angle
from pvid.twin.record import of_all_lanes

Float32 = npt.NDArray[np.float32]
Reasons = npt.NDArray[np.uint8]

COLUMNS = 13
_Y, _A, _B = 8, 9, 10
_FUNCTIONS_PER_STAGE = 6
_PLACES = [*range(8), 11, 12]  # of the entries of N


def assemble(sums: Float32) -> Float32:
    """Columns N1..N8, Y, a, b, 0, 0 [13, functions] from the sums [functions, 13] of a window."""
    s = sums.T
    n = [s[0], s[1], s[2], s[3] + s[8], s[9], s[4], s[5] + s[10], s[11]]
    return np.stack([*n, s[12], s[6], s[7], np.zeros_like(s[0]), np.zeros_like(s[0])])


def remove(x: Float32, column: int) -> Float32:
    """Columns x [13, K, lanes] without their components along one of them."""
    functions = x.shape[1]
    square = np.zeros(x.shape[2], np.float32)
    for k in range(functions):
        square = square + x[column, k] * x[column, k]
    usable = (square >= np.float32(1.17549435e-38)) & (square <= np.float32(3.4e38))
    inverse = np.float32(1) / np.sqrt(np.where(usable, square, np.float32(1)))
    direction = np.where(usable, x[column] * inverse, np.float32(0)).astype(np.float32, copy=False)
    along = np.zeros((COLUMNS, x.shape[2]), np.float32)
    for k in range(functions):
        along = along + direction[k] * x[:, k]
    return x - direction[None] * along[:, None]


def rows(
    window: Window, design: WeakTables, estimator: RelativeEstimator, angle: Angle | None
) -> tuple[Float32, Float32, npt.NDArray[np.bool_]]:
    """Whitened, projected columns [13, K, lanes] of a window at the estimator's p.

    Also the noise traces [3, lanes] and whether they are valid [lanes].
    """
    p = estimator.p
    with np.errstate(all="ignore"):
        x = np.repeat(assemble(window.sums)[:, :, None], p.shape[1], axis=2)
        if angle is not None:
            x = angle.correct(x, p, estimator.theta, window.phi, window.u)
        low, whitened = weak_whiten.factor(weak_whiten.gram(design, p), design.functions)
        noise = weak_whiten.traces(design, low)
        return remove(remove(weak_whiten.whiten(x, low, whitened), _A), _B), noise, whitened


def _stages_of_rows(design: WeakTables) -> int:
    parts = -(-design.functions // _FUNCTIONS_PER_STAGE)
    return 7 * design.functions + 2 + 5 * parts


def number_of_stages(design: WeakTables, iterations: int, estimator: RelativeEstimator, angle: Angle | None) -> int:
    """Stages of a window with all its solves."""
    remainder = 1 if angle is None else angle.stages
    rows_and_adds = _stages_of_rows(design) + remainder + design.functions
    solves = estimator.solve_stages(True) + (iterations - 1) * estimator.solve_stages(False)
    return rows_and_adds + solves + estimator.assessment_stages


def _passes(gate: Gate, x: Float32, design: WeakTables, estimator: RelativeEstimator, expected: Float32) -> bool:
    """Whether the gate accepts the window; all lanes must agree."""
    with np.errstate(all="ignore"):
        rss = np.zeros(x.shape[2], np.float32)
        for k in range(design.functions):
            e = x[_Y, k]
            for i, place in enumerate(_PLACES[: estimator.model.n_theta]):
                e = e - x[place, k] * estimator.theta[i]
            rss = rss + e * e
        return of_all_lanes(gate.passes(rss / ((np.float32(design.functions) - np.float32(2)) * expected)))


def stages(
    window: Window,
    design: WeakTables,
    iterations: int,
    estimator: RelativeEstimator,
    trust: Trust,
    angle: Angle | None,
    expected: Float32,
    gate: Gate,
) -> Iterator[Reasons | None]:
    """Processes a window, one stage per step; yields the reason to report [lanes], or None."""
    x, noise, whitened = rows(window, design, estimator, angle)
    for _ in range(_stages_of_rows(design) + (1 if angle is None else angle.stages) - 1):
        yield None
    # the last of these stages runs the gate and prepares the sums for the rows
    if gate.is_on and not _passes(gate, x, design, estimator, expected):
        estimator.counters["rejected_outlier"] += 1
        yield np.full(estimator.p.shape[1], Reason.REJECTED_OUTLIER, np.uint8)
        return
    estimator.noise = np.where(whitened, noise, estimator.noise)
    with np.errstate(all="ignore"):
        estimator.information.fade(trust.next_fade_factor())
    estimator.sums = estimator.information.read()
    yield None
    places = _PLACES[: estimator.model.n_theta]
    for k in range(design.functions):
        added = estimator.add(x[places, k], x[_Y, k])
        yield None if (added == Reason.ACCUMULATED).all() else added
    estimator.set_expected(expected)
    reason = np.full(estimator.p.shape[1], Reason.ACCUMULATED, np.uint8)
    for iteration in range(iterations):
        fallback = trust.fallback if iteration == 0 else None
        for solved in estimator.solve(ends_group=iteration == 0, fallback=fallback):
            yield None
            if solved is not None:
                reason = solved
        if not estimator.was_due:
            break
    size = estimator.size
    for _ in range(estimator.assessment_stages - 1):
        yield None
    with np.errstate(all="ignore"):
        candidate, above_noise = estimator.judged()
        variance_ratio = estimator.group_rss / ((np.float32(design.functions) - np.float32(2)) * expected)
    stepped = reason == Reason.UPDATED
    reported = trust.judge(reason, size, above_noise, variance_ratio, candidate)
    if angle is not None:
        with np.errstate(all="ignore"):
            switched = angle.switch(stepped, estimator.p, trust.largest_error(candidate), trust.groups)
        trust.renew(switched)
    yield reported
