"""From a recorded run to the jets of its signals on the steps of a design."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import Jet
from pvid.oracle.weak.comb import at_samples, compensator
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.polynomials import polynomial_weights

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
    """

    design: WeakDesign
    jets: dict[Jet, Float]
    raw: dict[str, Float]
    places: npt.NDArray[np.int64]
    parts: tuple[slice, ...]

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


def weights_of(design: WeakDesign, order: int) -> Float:
    """Weights of the filter that gives the derivative of this order from raw samples [1 / s^order]."""
    if design.comb:
        return at_samples(design.decimation, tuple(step_weights_of(design, order)))
    if order == 0:
        return polynomial_weights(design.taps, design.degree, 0)
    taps, degree = (design.rate_taps, design.rate_degree) if design.rate_taps > 1 else (design.taps, design.degree)
    if taps == 1:
        raise PvidError("a model that needs a derivative needs rate_taps or taps above 1")
    return polynomial_weights(taps, max(degree, order), order) * design.sample_rate**order


def step_weights_of(design: WeakDesign, order: int) -> Float:
    """Weights at the steps of the block sums; without a decimation those at the samples [1 / s^order]."""
    if not design.comb:
        return weights_of(design, order)
    half, count = design.compensator_of(order)
    return np.array(compensator(design.decimation, design.sample_rate, order, half, design.band_of(order), count))


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
    samples = samples_of(model, run)
    size = next(iter(samples.values())).size
    orders = {jet.order for jet in needed} | {0}
    margin = max(max(len(weights_of(design, order)) // 2 for order in orders), 2)
    places = np.arange(margin, size - margin, design.decimation)
    if len(places) < 2 * design.hop:
        raise PvidError(
            f"{size} samples do not fill one window of {design.window_s:g} s: record longer or shorten the window"
        )
    raw = {
        signal.name: of_hold(samples[signal.name]) if signal.hold == "zoh" else samples[signal.name]
        for signal in model.signals
    }
    known = _in_common(like, raw, design, orders) if like is not None and np.array_equal(places, like.places) else {}
    jets = {
        jet: known[jet] if jet in known else filtered(raw[jet.of], weights_of(design, jet.order))[places]
        for jet in needed
        if jet.of in raw
    }
    return Grid(design, jets, raw, places, (slice(0, len(places)),))


def _in_common(like: Grid, raw: Mapping[str, Float], design: WeakDesign, orders: set[int]) -> dict[Jet, Float]:
    """Jets of another grid with the same steps that these samples and this design have too."""
    filters = {one for one in orders if np.array_equal(weights_of(design, one), weights_of(like.design, one))}
    names = {name for name, x in raw.items() if name in like.raw and np.array_equal(x, like.raw[name])}
    return {jet: x for jet, x in like.jets.items() if jet.of in names and jet.order in filters}


def segments_of(samples: Mapping[str, Float]) -> list[slice]:
    """Stretches of a run in which no signal misses a sample."""
    finite = [np.isfinite(one) for one in samples.values()]
    if all(one.all() for one in finite):
        return [slice(0, len(finite[0]))] if len(finite[0]) else []
    there = np.logical_and.reduce(finite)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2], strict=True)]


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
