"""Twin of weak/values_q31.c: from the jets of a stretch to its channels, half window by half window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.settings.weak import NONE, WeakChannel
from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.q31.elementary import sign, tanh
from pvid.twin.q31.integer import WIDE, Int, clamp, integers, round_shift, shifted_with_rest, upper_product
from pvid.twin.q31.weak_front import rescaled

LATER = 2  # steps from a step's jets to its channels


def mean_sign(before: Int, v: Int, after: Int) -> Int:
    """Mean of sgn over a step, v linear there, Q30."""
    part, whole = 4 * np.abs(v), np.abs(after - before)
    mean = (part << 30) // np.maximum(whole, 1)
    return np.where(part >= whole, sign(v), np.sign(v) * mean)


@dataclass(frozen=True)
class Steps:
    """Channels of a stretch, and integrals at the ends of its halves.

    Attributes
    ----------
    channels : [channels, steps]
    edges : I^1 and I^2 at the end of each half that is followed by a step [2, integrands, halves]
    runs : of the last step whose jets were taken [runs]
    beyond : step whose jets made an input go beyond its reach; None: none did
    """

    channels: Int
    edges: Int
    runs: Int
    beyond: int | None


def _before(jets: Int, rates: Int, design: WeakDesignQ31, early: Int | None, lead: int) -> Int:
    """What the runs are at the first step, behind the outputs before it [runs, 1]."""
    model = design.model
    if early is None or model.prepare is None or not model.runs:
        return np.zeros((model.runs, 1), np.int64)
    held = np.sign(rates[:, :1]) * (2 * np.abs(rates[:, :1]) * lead // design.decimation)
    found, fits = model.prepare(early)
    found = np.where(fits, found[: model.runs], 0)
    weights = np.full(early.shape[1], 2)
    weights[:1] = 1
    orders = np.array([one.order for one in model.jet])
    plain, within = model.prepare(np.where(orders[:, np.newaxis] == 0, jets[:, :1], 0))
    known = (lead > 0) & within & (plain[: model.runs] == rates[:, :1])
    begun: Int = np.where(known, found @ weights[:, np.newaxis] + rates[:, :1], held)
    return begun


def steps(jets: Int, design: WeakDesignQ31, runs: Int, early: Int | None = None, lead: int = 0) -> Steps:
    """From jets [jets, n] of a stretch.

    Parameters
    ----------
    runs : the sums before it
    early : jets of the outputs before the first step [jets, outputs], where the runs begin with this stretch
    lead : ticks from the first sample to the first step there
    """
    model = design.model
    n = jets.shape[1]
    newest = np.zeros((model.runs + model.signs, n), np.int64)
    fits = np.ones(n, np.bool_)
    if model.prepare is not None and n:
        newest, fits = model.prepare(jets)
    beyond = int(np.argmin(fits)) if not fits.all() else None
    n = n if beyond is None else beyond
    jets, newest = jets[:, :n], newest[:, :n]
    rates, v = newest[: model.runs], newest[model.runs :]
    begun = _before(jets, rates, design, early, lead)
    rises = np.concatenate([begun, rates[:, 1:] + rates[:, :-1]], axis=1)
    sums = clamp(runs[:, np.newaxis] + np.cumsum(rises, axis=1), WIDE)
    nothing = np.zeros((len(model.channel), 0), np.int64)
    if n < LATER:
        return Steps(nothing, _no_edges(design), _last(sums, runs, n), beyond)
    now = v[:, :-1]
    before = np.concatenate([2 * v[:, :1] - v[:, 1:2], v[:, :-2]], axis=1)
    inputs = [
        jets[:, :-1],
        *(rescaled(sums[i : i + 1, :-1], one) for i, one in enumerate(design.run)),
        *(
            tanh(now[i : i + 1], width) if width else mean_sign(before[i : i + 1], now[i : i + 1], v[i : i + 1, 1:])
            for i, width in enumerate(design.sign_width)
        ),
    ]
    out, fits = model.values(np.concatenate(inputs))
    if not fits.all():
        bad = int(np.argmin(fits))
        # of step `bad`, computed with the jets of the next one, before these are taken
        beyond = n = bad + 1
        out = out[:, :bad]
    if out.shape[1] < LATER:
        return Steps(nothing, _no_edges(design), _last(sums, runs, n), beyond)
    once, twice, edges = _integrals(out[model.gains :], design)
    return Steps(_channels(out[: model.gains, :-1], once, twice, design), edges, _last(sums, runs, n), beyond)


def _no_edges(design: WeakDesignQ31) -> Int:
    return np.zeros((2, design.model.integrands, 0), np.int64)


def _last(sums: Int, before: Int, n: int) -> Int:
    return sums[:, n - 1] if n else before


def _integrals(f: Int, design: WeakDesignQ31) -> tuple[Int, Int, Int]:
    """Integrals [integrands, steps - 1] since the start of each half, and those at the ends of halves."""
    hop, count = design.hop, f.shape[1] - 1
    down, shift = integers(design.integral).reshape(-1, 2).T
    given = shifted_with_rest(f, down[:, np.newaxis])
    last, now, behind = given[:, :-2], given[:, 1:-1], given[:, 2:]
    before = np.concatenate([2 * last[:, :1] - now[:, :1], last[:, :-1]], axis=1)
    rise = integers(5 * (13 * (last + now) - (before + behind)))
    bend = integers(4 * (behind - before - 8 * (now - last)))
    once: Int = np.zeros((len(f), count), np.int64)
    twice: Int = np.zeros((len(f), count), np.int64)
    edges = np.zeros((2, len(f), max((count - 1) // hop, 0)), np.int64)
    first: Int = once[:, 0]
    second: Int = twice[:, 0]
    for k in range(1, count):
        next_first = first + rise[:, k - 1]
        second = second + round_shift(first + next_first + bend[:, k - 1], shift)
        first = next_first
        if k % hop == 0:
            edges[0, :, k // hop - 1] = first
            edges[1, :, k // hop - 1] = second
            first, second = 0 * first, 0 * second
        once[:, k], twice[:, k] = first, second
    return once, twice, edges


def of_one(fold: int, index: Int) -> Int:
    """Integral of 1 at steps of a half, in dt/2 or dt^2/48."""
    return 2 * index if fold == 1 else 24 * index * index


def _integral(one: WeakChannel, lift: int, once: Int, twice: Int, index: Int) -> Int:
    if one.integrand == NONE:
        return of_one(one.fold, index) << lift
    return np.asarray((once if one.fold == 1 else twice)[one.integrand])


def _channels(gains: Int, once: Int, twice: Int, design: WeakDesignQ31) -> Int:
    index = np.arange(gains.shape[1]) % design.hop
    out = np.zeros((len(design.model.channel), gains.shape[1]), np.int64)
    for k, one in enumerate(design.model.channel):
        if one.gain == NONE:
            continue
        value, form = gains[one.gain], design.format[k]
        if one.fold:
            value = upper_product(value, _integral(one, form.lift, once, twice, index))
        out[k] = round_shift(value, form.value)
    return out
