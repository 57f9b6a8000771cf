"""Twin of weak/window_q31.c: the sums of every whole window of a stretch, all windows at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.design.weak_q31 import HIGH_TERMS, TERM_BITS, TERMS
from pvid.settings.tables import WeakTablesQ31
from pvid.twin.f32.weak_window import window_count
from pvid.twin.q31.integer import Int, round_shift
from pvid.twin.q31.scaled import Scaled, scaled

_TERM_TABLE = ((slice(0, 2), 1), (slice(2, 10), 1), (slice(10, 14), 0), (slice(14, 15), 2))


def drives(u: Int, design: WeakTablesQ31) -> Int:
    """n^2 times the variance of U over all but the last sample of every window, n = W - 1 [windows]."""
    hop = (design.window - 1) // 2
    n = design.window - 1
    index = hop * np.arange(window_count(len(u), hop))[:, None] + np.arange(n)
    total = np.sum(u[index], axis=1, dtype=np.int64)
    return np.asarray(n * np.sum(u[index] * u[index], axis=1) - total * total)


def angle_sums(f: Int, design: WeakTablesQ31) -> Int:
    """Sum of F over all but the last sample of every window [windows]."""
    hop = (design.window - 1) // 2
    index = hop * np.arange(window_count(len(f), hop))[:, None] + np.arange(design.window - 1)
    return np.asarray(np.sum(f[index], axis=1, dtype=np.int64))


def curvatures(f: Int, design: WeakTablesQ31) -> Scaled:
    """Mean square of the second differences of F in each window [windows]."""
    hop = (design.window - 1) // 2
    squares, due = np.zeros(len(f), np.int64), np.zeros(len(f), np.int64)
    ends = np.arange(2 * design.lag, len(f), design.lag)
    squares[ends] = ((f[ends] - f[ends - design.lag]) - (f[ends - design.lag] - f[ends - 2 * design.lag])) ** 2
    due[ends] = 1
    index = hop * np.arange(window_count(len(f), hop))[:, None] + np.arange(design.window - 1)
    count = np.sum(due[index], axis=1)
    return scaled(np.sum(squares[index], axis=1), 0).over(scaled(np.maximum(count, 1), 0))


@dataclass(frozen=True)
class Window:
    """A whole window: sums [K, 15], the sum of F, and the mean square of its second differences."""

    sums: Int
    angle_sum: int
    curvature: Scaled


def _terms(index: int, now: Int, twice: Int, design: WeakTablesQ31) -> Int:
    """The terms [15, windows] at a sample: now [3, windows] is U F, F, U, twice four times their double integrals."""
    product, f, u = now
    uf = round_shift(product, design.uf_shift)
    integral = round_shift(3 * twice - 2 * now, np.array(design.integral_shift)[:, None])
    raw = [
        -(u * integral[0]),
        -(u * integral[1]),
        u * integral[2],
        u * (6 * index * index - 2),
        u * (index - (design.window - 1) // 2),
    ]
    high = [round_shift(r, s) for r, s in zip(raw, design.high_shift, strict=False)]
    for k, s in enumerate(design.high_shift):
        raw[k] = raw[k] - (high[k] << s)
    uiuf, uif, uiu, ui1, ut = (round_shift(r, s) for r, s in zip(raw, design.product_shift, strict=True))
    one = np.full_like(u, 1 << (TERM_BITS - 2))
    return np.stack([*high, -uf, -f, uiuf, uif, uiu, ui1, u, ut, -uf, -f, u, one, f])


def sums(f: Int, u: Int, design: WeakTablesQ31) -> Int:
    """Sums of all windows of one stretch of decimated samples: int64 [windows, functions, 13]."""
    hop = (design.window - 1) // 2
    count = window_count(len(f), hop)
    total = np.zeros((count, design.functions, TERMS), np.int64)
    if count == 0:
        return total
    starts = hop * np.arange(count)
    chi = design.chi.astype(np.int64)
    product = f * u
    before = np.stack([product[starts], f[starts], u[starts]])
    once = np.zeros_like(before)
    twice = np.zeros_like(before)
    for index in range(1, design.window - 1):
        at = starts + index
        now = np.stack([product[at], f[at], u[at]])
        next_once = once + before + now
        twice = twice + once + next_once
        once, before = next_once, now
        term = _terms(index, now, twice, design).T[:, None, :]
        for places, order in _TERM_TABLE:
            weight = chi[index, order][None, :, None]
            shift = 0 if places.start < HIGH_TERMS else design.sum_shift
            total[:, :, places] += round_shift(weight * term[:, :, places], shift)
    return total
