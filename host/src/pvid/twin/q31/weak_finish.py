"""Twin of weak/finish_q31.c: a complete window becomes rows and steps, one stage a tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.design.weak_q31 import COLUMN_TERMS
from pvid.settings.enums import Reason
from pvid.settings.tables import WeakTablesQ31
from pvid.twin.q31 import cholesky
from pvid.twin.q31.estimator import EstimatorQ31, length
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import (
    WIDE,
    Int,
    clamp,
    integers,
    reciprocal,
    round_shift,
    scale,
    square_root,
)
from pvid.twin.q31.scaled import Scaled, pick, scaled
from pvid.twin.q31.trust import VARIANCE_RATIO_BITS, TrustQ31
from pvid.twin.q31.weak_window import Window
from pvid.twin.record import Mask, of_all_lanes
from pvid.twin.weak_schedule import Work

COLUMNS = 12
COLUMN_LIMIT = 2**28
DIRECTION_BITS = 27
_Y, _A, _B = 8, 9, 10
_ASSEMBLED_PER_STAGE = 3
_ALONG_PER_STAGE = 6
_REMOVED_PER_STAGE = 3
_FITTED_PER_STAGE = 3
_FACTOR_PARTS, _TRACE_PARTS, _WHITEN_PARTS = 2, 3, 3
_FADE_PARTS = 2
_GRAM_22, _GRAM_DOWN, _ROW_BITS = 3, 16, 12
INVERSE_BITS = 15
INVERSE_LIMIT = 2**26


def assemble(sums: Int, design: WeakTablesQ31) -> Int:
    """Columns N1..N8, Y, a, b, 0 [12, functions] from the sums [functions, 15] of a window."""
    share = round_shift(sums * design.multiplier.astype(np.int64), np.array(design.shift)).T
    columns = [sum((share[k] for k in parts), np.zeros_like(share[0])) for parts in COLUMN_TERMS]
    return np.stack([*columns, np.zeros_like(share[0])])


def gram(design: WeakTablesQ31, estimator: EstimatorQ31) -> tuple[Int, Int]:
    """R0 at the estimator's p, as integers times 2^-bits with even bits: ([K (K + 1) / 2, lanes], bits [lanes])."""
    theta, bits = estimator.theta, estimator.theta_bits
    one = np.full(estimator.lanes, 1 << 29, np.int64)
    parts = []
    for k in (1, 4):
        m, h = cholesky.to_block(theta[k][None], 30)
        parts.append((m[0], bits[k] - h))
    (two, two_bits), (zero, zero_bits) = parts
    factors = [
        (one, integers(29)),
        (two, two_bits),
        (zero, zero_bits),
        (two * two, 2 * two_bits),
        (two * zero, two_bits + zero_bits),
        (zero * zero, 2 * zero_bits),
    ]
    scaled = []
    for (factor, factor_bits), table_bits in zip(factors, design.gram_bits, strict=True):
        m, h = cholesky.to_block(factor[None], 29)
        scaled.append((m[0], factor_bits - h + table_bits))
    common = np.min(np.stack([np.broadcast_to(b, one.shape) for _, b in scaled]), axis=0)
    common = common - (common & 1)
    total = np.zeros((design.gram.shape[1], estimator.lanes), np.int64)
    for table, (m, m_bits) in zip(design.gram.astype(np.int64), scaled, strict=True):
        total = total + table[:, None] * scale(m, m_bits - common)
    return total, common


def factor(packed: Int, functions: int) -> tuple[Int, Int, Int, Int, Mask]:
    """L [K, K, lanes] in Q30, its inverse diagonal (m, k) and row exponents [K, lanes], and whether it exists."""
    lanes = packed.shape[1]
    low = np.zeros((functions, functions, lanes), np.int64)
    rows, columns = np.tril_indices(functions)
    low[rows, columns] = packed
    exponents = np.stack([cholesky.half_exponent(np.maximum(low[i, i], 1)) for i in range(functions)])
    low = clamp(scale(low, exponents[:, None] + exponents[None]), cholesky.ONE)
    inverse = np.zeros((functions, lanes), np.int64)
    k = np.zeros((functions, lanes), np.int64)
    whitened = np.ones(lanes, np.bool_)
    for row in range(functions):
        diagonal = low[row, row]
        pivot = diagonal << 30
        for j in range(row):
            total = low[row, j] << 30
            for i in range(j):
                total = clamp(total - low[row, i] * low[j, i], WIDE)
            low[row, j] = cholesky.divide(total, inverse[j], k[j], cholesky.ONE)
            pivot = np.where(pivot < 0, pivot, pivot - low[row, j] * low[row, j])
        whitened = whitened & (diagonal >= 2**28) & (pivot >= (diagonal << (30 - cholesky.PIVOT_SHIFT)))
        inverse[row], k[row] = reciprocal(square_root(np.where(whitened, pivot, np.int64(1) << 60)))
    return low, inverse, k, exponents, whitened


class Held:
    """Clamps numbers to COLUMN_LIMIT; `saturated`: lanes in which one was beyond."""

    def __init__(self, lanes: int) -> None:
        self.saturated = np.zeros(lanes, np.bool_)

    def __call__(self, x: Int, where: Mask | bool = True) -> Int:
        """x [..., lanes] held within the limit."""
        self.saturated |= (np.abs(x) >= COLUMN_LIMIT).reshape(-1, x.shape[-1]).any(axis=0) & where
        return clamp(x, COLUMN_LIMIT)


@dataclass(frozen=True)
class Whitening:
    """What `factor` gives, and the format of the Gram matrix, [lanes]."""

    low: Int
    inverse: Int
    k: Int
    exponents: Int
    whitened: Mask
    bits: Int


def whitening(design: WeakTablesQ31, estimator: EstimatorQ31) -> Whitening:
    """The factor of R0 at the estimator's p."""
    packed, bits = gram(design, estimator)
    return Whitening(*factor(packed, design.functions), bits)


def whiten(x: Int, by: Whitening, held: Held) -> Int:
    """L^-1 of the columns x [12, K, lanes]."""
    out = np.zeros_like(x)
    for row in range(x.shape[1]):
        total = held(scale(x[:, row], by.exponents[row] - (by.bits - 30) // 2), by.whitened) << 30
        for j in range(row):
            total = total - by.low[row, j] * out[:, j]
        out[:, row] = held(cholesky.divide(total, by.inverse[row], by.k[row], COLUMN_LIMIT), by.whitened)
    return np.where(by.whitened, out, held(x, ~by.whitened))


def traces(design: WeakTablesQ31, by: Whitening) -> list[Scaled]:
    """Sums over the rows of L^-1 of their products with the Gram tables 22, 20 + 02, 00."""
    functions, lanes = by.inverse.shape
    rows_of, columns_of = np.tril_indices(functions)
    tables = np.zeros((3, functions, functions), np.int64)
    tables[:, rows_of, columns_of] = design.gram[_GRAM_22:].astype(np.int64) >> _GRAM_DOWN
    total = [scaled(np.zeros(lanes, np.int64), 0)] * 3
    for row in range(functions):
        inverted = np.zeros((row + 1, lanes), np.int64)
        for j in range(row, -1, -1):
            rest = np.full(lanes, cholesky.ONE << INVERSE_BITS if j == row else 0, np.int64)
            for k in range(j + 1, row + 1):
                rest = rest - inverted[k] * by.low[k, j]
            inverted[j] = cholesky.divide(rest, by.inverse[j], by.k[j], INVERSE_LIMIT)
        exponents = by.exponents[: row + 1]
        h = np.max(length(inverted) - exponents, axis=0) - _ROW_BITS
        w = scale(inverted, h + exponents)
        for i, table in enumerate(tables[:, : row + 1, : row + 1]):
            own = np.diagonal(table)[:, None]
            below = np.sum((table - np.diag(np.diagonal(table)))[:, :, None] * w[None], axis=1)
            form = np.sum(w * (2 * below + w * own), axis=0)
            table_bits = design.gram_bits[_GRAM_22 + i] - _GRAM_DOWN
            total[i] = total[i].plus(scaled(form, 2 * (h - INVERSE_BITS) - table_bits + by.bits - 30))
    return total


def noise_of(design: WeakTablesQ31, by: Whitening, estimator: EstimatorQ31) -> list[Scaled]:
    """The new `EstimatorQ31.noise`: from the traces if the window is whitened, else unchanged."""
    noise = []
    assert estimator.model.noisy is not None
    first, second = estimator.model.noisy
    more = [a - t for a, t in zip(estimator.align, estimator.theta_bits, strict=True)]
    shifts = (2 * more[first], more[first] + more[second] - 1, 2 * more[second])
    for own, known, shift in zip(traces(design, by), estimator.noise, shifts, strict=True):
        noise.append(pick(by.whitened, own.over(scaled(design.functions, 0)).shifted(shift), known))
    return noise


def remove(x: Int, column: int, held: Held) -> Int:
    """Columns x [12, K, lanes] without their components along one of them."""
    direction, _ = cholesky.to_block(x[column], DIRECTION_BITS)
    square = np.sum(direction * direction, axis=0)
    inverse, k = reciprocal(np.maximum(square_root(square), 1))
    direction = np.where(square > 0, round_shift(direction * inverse, 31 - k), 0)
    along = round_shift(np.sum(direction * x, axis=1), 30)
    return held(x - round_shift(direction[None] * along[:, None], 30))


def rows(sums: Int, by: Whitening, design: WeakTablesQ31) -> tuple[Int, Mask]:
    """Whitened, projected columns [12, K, lanes] of a window with sums [K, 15], and whether they are saturated."""
    lanes = len(by.whitened)
    x = np.repeat(assemble(sums, design)[:, :, None], lanes, axis=2)
    held = Held(lanes)
    x = remove(remove(whiten(x, by, held), _A, held), _B, held)
    return x, held.saturated


def _stages_before_add(design: WeakTablesQ31) -> int:
    functions = design.functions
    whole = functions // 3
    triangles = 3 * whole + (_FACTOR_PARTS + _TRACE_PARTS + _WHITEN_PARTS) * (functions - whole)
    assembled = -(-functions // _ASSEMBLED_PER_STAGE)
    return (
        1
        + functions
        + assembled
        + triangles
        + 2 * (2 + -(-functions // _ALONG_PER_STAGE) + -(-functions // _REMOVED_PER_STAGE))
        + -(-functions // _FITTED_PER_STAGE)
    )


def number_of_stages(design: WeakTablesQ31, iterations: int, estimator: EstimatorQ31) -> int:
    """Stages of a window."""
    solves = estimator.solve_stages(True) + (iterations - 1) * estimator.solve_stages(False)
    rows = _stages_before_add(design) + _FADE_PARTS + design.functions
    return rows + solves + estimator.assessment_stages + 1


def _variance_ratio(rss: Int, design: WeakTablesQ31, expected: Scaled) -> Scaled:
    """Residual variance of a window over its expectation [lanes]."""
    return scaled(rss, 0).over(scaled(design.functions - 2, 0).times(expected))


def _passes(
    gate: GateQ31, x: Int, saturated: Mask, design: WeakTablesQ31, estimator: EstimatorQ31, expected: Scaled
) -> bool:
    """Whether the gate accepts the window; all lanes must agree."""
    rss = np.zeros(estimator.lanes, np.int64)
    for k in range(design.functions):
        e = clamp(estimator.innovation(x[: estimator.model.n_theta, k], x[_Y, k])[0], COLUMN_LIMIT)
        rss = clamp(rss + e * e, WIDE)
    return of_all_lanes(gate.passes(_variance_ratio(rss, design, expected), ~saturated))


def stages(
    window: Window,
    design: WeakTablesQ31,
    iterations: int,
    estimator: EstimatorQ31,
    trust: TrustQ31,
    pivot: Scaled,
    gate: GateQ31,
) -> Work:
    """Processes a window, one stage per step; yields the reason to report [lanes], or None.

    pivot: what the noise of the pivot's sensor adds to the variance of a row for each mean square of a second
    difference of F.
    """
    expected = scaled(estimator.row_sd * estimator.row_sd, -16).plus(pivot.times(window.curvature))
    by = whitening(design, estimator)
    x, saturated = rows(window.sums, by, design)
    for _ in range(_stages_before_add(design) - 1):
        yield None
    # the last of these stages runs the gate and sets the noise of the rows
    if gate.is_on and not _passes(gate, x, saturated, design, estimator, expected):
        estimator.counters["rejected_outlier"] += 1
        yield np.full(estimator.lanes, Reason.REJECTED_OUTLIER, np.uint8)
        return
    yield None
    estimator.noise = noise_of(design, by, estimator)
    yield from estimator.fade(trust.next_fade_factor())
    for k in range(design.functions):
        y = np.where(saturated, 2**31 - 1, x[_Y, k])
        added = estimator.add(x[: estimator.model.n_theta, k], y)
        yield None if (added == Reason.ACCUMULATED).all() else added
    estimator.set_expected(expected)
    reason = np.full(estimator.lanes, Reason.ACCUMULATED, np.uint8)
    for iteration in range(iterations):
        fallback = trust.fallback if iteration == 0 else None
        for solved in estimator.solve(ends_group=iteration == 0, fallback=fallback):
            yield None
            if solved is not None:
                reason = solved
        if not estimator.was_due:
            break
    size = estimator.size
    for _ in range(estimator.assessment_stages):
        yield None
    candidate, above_noise = estimator.judged()
    variance_ratio = _variance_ratio(estimator.group_rss, design, expected)
    yield trust.judge(reason, size, above_noise, variance_ratio.fixed(VARIANCE_RATIO_BITS), candidate)
