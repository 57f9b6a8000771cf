"""From a recorded run to the jets of its signals on the steps of a design."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.corners import OfInput
from pvid.model.signals import Jet
from pvid.oracle.weak.design import WeakDesign
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]


def filtered(x: Float, weights: Float) -> Float:
    """sum_i weights_i x_(k + i - half) [n]; wrong within half of the ends."""
    return np.asarray(np.convolve(x, weights[::-1], "same"))


def of_hold(x: Float) -> Float:
    """Samples that stand for an input held from t_k to t_(k+1): its mean about t_k, right to fourth order in dt."""
    e = np.concatenate([x[:1], x[:1], x, x[-1:]])
    return np.asarray((-e[:-3] + 13 * e[1:-2] + 13 * e[2:-1] - e[3:]) / 24)


@dataclass(frozen=True)
class Grid:
    """Jets of the signals at the steps of a design.

    Attributes
    ----------
    design : of these steps
    jets : jet -> values [n]
    raw : name -> samples as recorded, held ones filtered; NaN between segments
    places : sample of each step [n]
    parts : steps of each segment, all but the last whole half windows
    given : name -> samples as they were given, of a run of one segment
    """

    design: WeakDesign
    jets: dict[Jet, Float]
    raw: dict[str, Float]
    places: npt.NDArray[np.int64]
    parts: tuple[slice, ...]
    given: dict[str, Float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Steps."""
        return len(self.places)

    @property
    def raw_size(self) -> int:
        """Samples."""
        return len(next(iter(self.raw.values())))

    @property
    def across(self) -> npt.NDArray[np.int64]:
        """Numbers of the windows that would lie across two segments."""
        return np.array([part.stop // self.design.hop - 1 for part in self.parts[:-1]], np.int64)


def with_jumps(
    run: Mapping[str, npt.ArrayLike], made: Mapping[str, OfInput], sample_rate: float, like: Grid | None = None
) -> dict[str, npt.ArrayLike]:
    """A run with these signals of its inputs [n]; the first sample is also the one before it. Those of an input that
    another grid was given, too, are its own."""
    out = dict(run)
    for name, of in made.items():
        if of.name not in run:
            continue
        if like is not None and run[of.name] is like.given.get(of.name) and like.design.sample_rate == sample_rate:
            out[name] = like.given[name]
            continue
        u = np.asarray(run[of.name], np.float64)
        before = np.concatenate([u[:1], u[:-1]])
        before = np.where(np.isnan(before) & np.isfinite(u), u, before)
        out[name] = {"jump": (u - before) / (12 * sample_rate), "before": before, "after": u}[of.kind]
    return out


def samples_of(model: CompiledModel, run: Mapping[str, npt.ArrayLike]) -> dict[str, Float]:
    """The arrays of a run by signal, of one length."""
    out = {}
    for signal in model.signals:
        if signal.name not in run:
            raise PvidError(f"the run has no column {signal.name} [{signal.unit or '1'}], which {model.name} needs")
        out[signal.name] = np.asarray(run[signal.name], np.float64)
    sizes = {x.size for x in out.values()}
    if len(sizes) != 1:
        raise PvidError(f"the columns of the run differ in length: {sorted(sizes)}")
    return out


def grid_of(
    model: CompiledModel,
    run: Mapping[str, npt.ArrayLike],
    design: WeakDesign,
    needed: set[Jet],
    like: Grid | None = None,
) -> Grid:
    """Values of the needed jets at every step.

    Parameters
    ----------
    run : name -> samples [n]
    needed : jets of signals
    like : another grid, from which a jet is taken that has the same samples and filter
    """
    samples, held = samples_of(model, run), {one.name for one in model.signals if one.hold == "zoh"}
    size = next(iter(samples.values())).size
    orders = {jet.order for jet in needed} | {0}
    margin = max(max(len(design.weights(order)) // 2 for order in orders), 2)
    places = np.arange(margin, size - margin, design.decimation)
    if len(places) < 2 * design.hop:
        raise PvidError(
            f"{size} samples do not fill one window of {design.window_s:g} s: record longer or shorten the window"
        )
    given = {} if like is None else like.given
    raw = {
        name: like.raw[name] if like is not None and x is given.get(name) else of_hold(x) if name in held else x
        for name, x in samples.items()
    }
    known = _in_common(like, raw, design, orders) if like is not None and np.array_equal(places, like.places) else {}
    jets = {
        jet: known[jet] if jet in known else filtered(raw[jet.of], design.weights(jet.order))[places]
        for jet in needed
        if jet.of in raw
    }
    return Grid(design, jets, raw, places, (slice(0, len(places)),), samples)


def _in_common(like: Grid, raw: Mapping[str, Float], design: WeakDesign, orders: set[int]) -> dict[Jet, Float]:
    """Jets of another grid with the same steps that these samples and this design have too."""
    filters = {one for one in orders if np.array_equal(design.weights(one), like.design.weights(one))}
    shared = {name: x for name, x in raw.items() if name in like.raw}
    names = {name for name, x in shared.items() if x is like.raw[name] or np.array_equal(x, like.raw[name])}
    return {jet: x for jet, x in like.jets.items() if jet.of in names and jet.order in filters}


def segments_of(samples: Mapping[str, Float]) -> list[slice]:
    """Stretches of a run in which no signal misses a sample."""
    finite = [np.isfinite(one) for one in samples.values()]
    if all(one.all() for one in finite):
        return [slice(0, len(finite[0]))] if len(finite[0]) else []
    there = np.logical_and.reduce(finite)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def longest_of_each(segments: Sequence[slice], run: Mapping[str, npt.ArrayLike]) -> list[slice]:
    """The longest segment of each recording of a run (pvid.rig.run.NUMBER); of the run where it is one recording."""
    longest: dict[float, slice] = {}
    for one in segments:
        number = float(np.asarray(run[NUMBER])[one.start]) if NUMBER in run else 0.0
        before = longest.setdefault(number, one)
        if one.stop - one.start > before.stop - before.start:
            longest[number] = one
    return list(longest.values())


def largest(x: Float) -> float:
    """Largest magnitude of a signal [n] with gaps; 0 where no sample is there."""
    return float(np.max(np.abs(x), initial=0.0, where=np.isfinite(x)))


def in_segments(x: Float, change: Callable[[Float], Float]) -> Float:
    """A change of a signal [n] in each of its segments by itself; NaN between them."""
    parts = segments_of({"": x})
    if len(parts) == 1 and parts[0] == slice(0, len(x)):
        return change(x)
    out = np.full(len(x), np.nan)
    for part in parts:
        out[part] = change(x[part])
    return out


def density(signal: Signal, design: WeakDesign) -> float:
    """Variance of white noise at the steps that has the sensor's density in the band of the test functions."""
    return signal.sd**2 / (design.decimation if design.taps > 1 or design.comb else 1)
