"""Twin of weak/sums_q31.c: sums of half windows and their join, all windows of a stretch at once."""

from __future__ import annotations

import numpy as np

from pvid.settings.weak import NONE, WeakChannel
from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.q31.integer import Int, round_shift, upper_product
from pvid.twin.q31.weak_values import Steps

_BLOCK, _DOWN, _FINE_DOWN, _UPPER = 4, 14, 22, 32


def half_sums(channels: Int, design: WeakDesignQ31) -> Int:
    """A_h of whole halves: [channels, halves, H + 1, 2]."""
    hop, turn = design.hop, 2 * design.hop
    halves = channels.shape[1] // hop
    blocks = channels[:, : halves * hop].reshape(len(channels), halves, hop // _BLOCK, _BLOCK)
    circle = design.circle.astype(np.int64)
    out = np.zeros((len(channels), halves, design.highest + 1, 2), np.int64)
    for h in range(design.highest + 1):
        place = (h * np.arange(hop)) % turn
        for part, where in enumerate((place, (place + turn - hop // 2) % turn)):
            products = blocks * circle[where].reshape(-1, _BLOCK)
            down = np.add.reduce(products, axis=-1) >> (_FINE_DOWN if design.fine else _DOWN)
            out[:, :, h, part] = np.add.reduce(round_shift(down, design.sum_shift), axis=-1)
    return out


def _edge(edges: Int, one: WeakChannel, fold: int, hop: int, lift: int) -> Int | int:
    """I^fold at the end of each half."""
    if one.integrand == NONE:
        once = 2 * hop if one.fold == 1 else 24 * hop
        return (once * hop if fold == 2 else once) << lift
    return np.asarray(edges[fold - 1, one.integrand][:, np.newaxis, np.newaxis])


def _shifted(edge: Int | int, sums: Int, shift: int) -> Int:
    """2^-shift of their product."""
    return np.asarray((upper_product(edge, sums) << max(_UPPER - shift, 0)) >> max(shift - _UPPER, 0))


def windows(steps: Steps, design: WeakDesignQ31) -> Int:
    """S_h of the whole windows of a stretch [windows, channels, H + 1, 2]."""
    sums = half_sums(steps.channels, design)
    count = max(sums.shape[1] - 1, 0)
    odd = (np.arange(design.highest + 1) % 2 == 1)[np.newaxis, :, np.newaxis]
    out = np.zeros((count, len(sums), design.highest + 1, 2), np.int64)
    edges = steps.edges[:, :, :count]
    for k, one in enumerate(design.model.channel):
        form = design.format[k]
        first, second = sums[k, :-1], sums[k, 1:]
        own = np.where(odd, first - second, first + second) >> form.own
        shift = np.zeros_like(own)
        if one.fold:
            shift = shift + _shifted(
                _edge(edges, one, one.fold, design.hop, form.lift), sums[one.plain, 1:], form.plain
            )
        if one.fold > 1:
            shift = shift + _shifted(_edge(edges, one, 1, design.hop, form.lift), sums[one.ramp, 1:], form.ramp)
        out[:, k] = own + np.where(odd, -shift, shift)
        if one.gain == NONE:
            out[:, k, 0, 0] = 2 * design.hop
    return out
