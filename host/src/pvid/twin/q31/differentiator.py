"""Twin of differentiator_q31.c. It feeds forward, so all ticks are computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.design.fir import ORDERS
from pvid.design.fir_q31 import Y_LOWEST
from pvid.settings.tables import FirBankQ31
from pvid.twin.f32.differentiator import Ticks, ticks_of
from pvid.twin.q31.integer import Int, round_shift

Mask = npt.NDArray[np.bool_]


def derivatives(phi: Int, y: Int, within: Mask, bank: FirBankQ31) -> tuple[Int, Int, Ticks]:
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
    int64 [ticks, 5] of phi and [ticks, 3] (orders 2, 3, 4) of y, zero where there is no result, and the ticks that have
    one.
    """
    out_phi = np.zeros((len(phi), ORDERS), np.int64)
    out_y = np.zeros((len(phi), ORDERS - Y_LOWEST), np.int64)
    at = ticks_of(within, bank.window, bank.every)
    for first, last, now in at.rows:
        phi_points, y_points = _points(phi[first:last], bank.every), _points(y[first:last], bank.every)
        count = len(phi_points) - bank.memory + 1
        for k in range(ORDERS):
            out_phi[now, k] = round_shift(_sum(phi_points, count, bank, k), bank.phi_shift[k])
        for k in range(Y_LOWEST, ORDERS):
            out_y[now, k - Y_LOWEST] = round_shift(_sum(y_points, count, bank, k), bank.y_shift[k - Y_LOWEST])
    return out_phi, out_y, at


def _points(x: Int, block: int) -> Int:
    """The sums of blocks of a stretch [n // block]."""
    return np.asarray(x[: len(x) // block * block].reshape(-1, block).sum(axis=1))


def _sum(x: Int, count: int, bank: FirBankQ31, order: int) -> Int:
    """The exact sum of one order of the points x in each of the `count` full windows."""
    reach = bank.half * bank.stride
    middle = x[reach : reach + count]
    total = middle * bank.centre if order == 0 else np.zeros(count, np.int64)
    for i in range(bank.half):
        away = (i + 1) * bank.stride
        after = x[reach + away : reach + away + count]
        before = x[reach - away : reach - away + count]
        pair = (after + before) - 2 * middle if order % 2 == 0 else after - before
        total = total + int(bank.weights[order, i]) * pair
    return total
