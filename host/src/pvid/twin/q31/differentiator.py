"""Twin of differentiator_q31.c. It feeds forward, so all ticks are computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.design.fir import ORDERS
from pvid.design.fir_q31 import Y_LOWEST
from pvid.settings.tables import FirBankQ31
from pvid.twin.f32.differentiator import segments
from pvid.twin.q31.integer import Int, round_shift

Mask = npt.NDArray[np.bool_]


def derivatives(phi: Int, y: Int, within: Mask, bank: FirBankQ31) -> tuple[Int, Int, Mask]:
    """Derivatives after every tick.

    Parameters
    ----------
    phi, y
        Counts about their offsets, int64 [ticks].
    within
        bool [ticks]: which samples are within full scale; one that is not empties the window.
    bank
        The integer bank.

    Returns
    -------
    int64 [ticks, 5] of phi and [ticks, 3] (orders 2, 3, 4) of y, zero until the window is full, and bool [ticks]:
    whether it was.
    """
    out_phi = np.zeros((len(phi), ORDERS), np.int64)
    out_y = np.zeros((len(phi), ORDERS - Y_LOWEST), np.int64)
    ready = np.zeros(len(phi), np.bool_)
    for first, last in segments(within):
        count = last - first - bank.window + 1
        if count <= 0:
            continue
        now = slice(first + bank.window - 1, last)
        ready[now] = True
        phi_points, y_points = _points(phi[first:last], bank.block), _points(y[first:last], bank.block)
        for k in range(ORDERS):
            out_phi[now, k] = round_shift(_sum(phi_points, count, bank, k), bank.phi_shift[k])
        for k in range(Y_LOWEST, ORDERS):
            out_y[now, k - Y_LOWEST] = round_shift(_sum(y_points, count, bank, k), bank.y_shift[k - Y_LOWEST])
    return out_phi, out_y, ready


def _points(x: Int, block: int) -> Int:
    """The sums of `block` samples up to each from the first full one on."""
    if block == 1:
        return x
    sums = np.concatenate([np.zeros(1, np.int64), np.cumsum(x)])
    return np.asarray(sums[block:] - sums[:-block])


def _sum(x: Int, count: int, bank: FirBankQ31, order: int) -> Int:
    """The exact sum of one order of the points x in each of the `count` full windows."""
    delay = bank.half * bank.stride
    middle = x[delay : delay + count]
    total = middle * bank.centre if order == 0 else np.zeros(count, np.int64)
    for i in range(bank.half):
        away = (i + 1) * bank.stride
        after = x[delay + away : delay + away + count]
        before = x[delay - away : delay - away + count]
        pair = (after + before) - 2 * middle if order % 2 == 0 else after - before
        total = total + int(bank.weights[order, i]) * pair
    return total
