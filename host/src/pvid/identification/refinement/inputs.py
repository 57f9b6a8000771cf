"""What the refinement is driven by and fitted to: inputs at the steps of the integration, readings at the samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.codegen.refine import RefineFunctions
from pvid.design.second_derivative import second_derivative
from pvid.identification.refinement.spline import ORDER, Spline
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Integral, Jet, jets, sgn
from pvid.oracle.weak.channels import broadcast, evaluated
from pvid.rig.breaks import breaks
from pvid.rig.gaps import bridge, longest_stretch, stretches
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]

EDGE = 1.25  # times the drive's: the pass band
HIGHEST = 0.25  # of the sample rate: a pass band that its filter is exact in to 1e-5
_FEWEST = 12  # values of a second derivative: its spline is of order five
_ROUNDING = 1e-9  # [s]: of times


def held(values: Float, sub: int) -> Float:
    """An input that holds from sample to sample, at the steps [steps, 3]."""
    return np.repeat(values, sub)[:, None] * np.ones(3)


def smooth(values: Float, sub: int) -> Float:
    """An input that is the cubic through four samples between the middle two, at the steps [steps, 3].

    A straight line is short of the curvature: of a sine with 20 samples a period by 0.8 % in the mean.
    """
    x = np.concatenate([[_before(values[:3])], values, [_before(values[:-4:-1])], values[-1:]])
    share = (np.arange(sub)[:, None] + np.array([0.0, 0.5, 1.0])) / sub
    a, b, c = share + 1, share - 1, share - 2
    weights = (-share * b * c / 6, a * b * c / 2, -a * share * c / 2, a * share * b / 6)
    n = len(values)
    return np.asarray(sum(x[k : k + n, None, None] * weight for k, weight in enumerate(weights)), np.float64).reshape(
        -1, 3
    )


def _before(three: Float) -> float:
    """The sample before three, of their parabola."""
    return float(three @ np.array([3.0, -3.0, 1.0]))


def straight(values: Float, sub: int) -> Float:
    """An input that is straight between samples, at the steps [steps, 3]."""
    after = np.append(values[1:], values[-1])
    share = (np.arange(sub)[:, None] + np.array([0.0, 0.5, 1.0])) / sub
    return np.asarray((values[:, None, None] + (after - values)[:, None, None] * share).reshape(-1, 3))


def second_derivative_of(x: Float, rate: float, noise: float) -> Float:
    """x'' at the samples, in the band in which x stands above its noise; NaN where the filter lacks samples.

    Parameters
    ----------
    x : [n], NaN where there is no sample
    noise : standard deviation of a sample
    """
    return Curve.second_derivative(x, rate, noise)(np.arange(len(x)) / rate)


class Curve:
    """A signal between its samples: splines of order five, one for each stretch without a gap.

    Parameters
    ----------
    pieces : equally spaced times [s] since the first sample, and values there, of each stretch
    """

    def __init__(self, pieces: Iterable[tuple[Float, Float]]) -> None:
        self._pieces = [
            (times[0], times[-1], Spline(float(times[0]), float(times[-1] - times[0]) / (len(times) - 1), values))
            for times, values in pieces
        ]

    @classmethod
    def of(cls, x: Float, rate: float) -> Curve:
        """Through the samples x [n], NaN where there is none."""
        there = [(first, end) for first, end in zip(*stretches(np.isfinite(x)), strict=True) if end - first > ORDER]
        return cls((np.arange(first, end) / rate, x[first:end]) for first, end in there)

    @classmethod
    def second_derivative(cls, x: Float, rate: float, noise: float, least_hz: float = 0.0) -> Curve:
        """x'', see second_derivative_of.

        Parameters
        ----------
        least_hz : the band reaches at least so far
        """
        edge = min(max(EDGE * drive_edge_hz(x, rate, noise), least_hz), HIGHEST * rate)
        if edge <= 0:
            return cls(())
        front = second_derivative(rate, edge)
        pieces = []
        for first, end in zip(*stretches(np.isfinite(x)), strict=True):
            if end - first >= front.mean * (2 * front.half + _FEWEST):
                times, found = front.apply(x[first:end], rate)
                pieces.append((times + first / rate, found))
        return cls(pieces)

    def __call__(self, t: Float, late: float = 0.0, slope: bool = False) -> Float:
        """Values, or slopes, at rising times t + late [s]; NaN where t is beyond its stretches."""
        out = np.full(t.shape, np.nan)
        for begin, end, spline in self._pieces:
            part = slice(*np.searchsorted(t, [begin - _ROUNDING, end + _ROUNDING]))
            out[part] = spline(np.clip(t[part] + late, begin, end), slope)
        return out


class LateInputs:
    """Inputs at the steps that come as late as the sensors which measure them: those that are held do not.

    Parameters
    ----------
    mean : samples in an average, which is a sample of the motion
    least_hz : of the bands of second derivatives
    """

    def __init__(
        self,
        model: CompiledModel,
        made: RefineFunctions,
        signals: Mapping[str, Float],
        rate: float,
        sub: int,
        mean: int = 1,
        least_hz: float = 0.0,
    ) -> None:
        samples = len(signals[made.outputs[0]]) // mean
        steps = np.arange(2 * sub * samples + 1, dtype=np.float64)
        self._at: Float = (steps * (mean / (2 * sub)) + (mean - 1) / 2) / rate
        self._shape = sub * samples, 3, len(made.inputs)
        self._fixed: dict[int, Float] = {}
        self._moved: dict[int, tuple[sp.Expr, dict[Jet, Curve]]] = {}
        self._kept: dict[float, tuple[Float, Float]] = {}
        for k, jet in enumerate(made.inputs):
            value = model.with_knowns(model.opaque.get(jet, jet))
            parts = sorted(jets(value), key=str)
            if is_late(model, jet):
                self._moved[k] = value, {one: _curve(model, one, signals, rate, least_hz) for one in parts}
            else:
                self._fixed[k] = _input(model, jet, signals, rate, sub)

    def __call__(self, late: float) -> tuple[Float, Float]:
        """u and du [steps, 3, inputs], `late` [s] later than at the sensors; NaN where they are not known."""
        if late not in self._kept:
            if len(self._kept) > 4:
                self._kept.pop(next(iter(self._kept)))
            u, du = np.zeros(self._shape), np.zeros(self._shape)
            for k, fixed in self._fixed.items():
                u[..., k] = fixed
            for k, (value, curves) in self._moved.items():
                now = {jet: curve(self._at, late) for jet, curve in curves.items()}
                slopes = {jet: curve(self._at, late, slope=True) for jet, curve in curves.items()}
                rate = sum(broadcast(evaluated(value.diff(jet), now), len(self._at)) * slopes[jet] for jet in curves)
                for out, fine in ((u, broadcast(evaluated(value, now), len(self._at))), (du, np.asarray(rate))):
                    out[..., k] = np.stack([fine[0:-2:2], fine[1:-1:2], fine[2::2]], 1)
            self._kept[late] = u, du
        return self._kept[late]


def is_late(model: CompiledModel, jet: Jet) -> bool:
    """Whether an input follows from samples alone that sensors take: all of it comes as late as they do."""
    value = model.opaque.get(jet, jet)
    return not value.has(Integral, sgn, sp.Abs) and all(model.signal(one.of).hold != "zoh" for one in jets(value))


def _curve(model: CompiledModel, jet: Jet, signals: Mapping[str, Float], rate: float, least_hz: float) -> Curve:
    if jet.order == 2:
        return Curve.second_derivative(signals[jet.of], rate, model.signal(jet.of).sd, least_hz)
    if jet.order == 0:
        return Curve.of(signals[jet.of], rate)
    raise _refused(model, jet)


def without_jumps(
    model: CompiledModel, made: RefineFunctions, signals: Mapping[str, Float], rate: float, slow_hz: float
) -> tuple[dict[str, Float], list[int]]:
    """Signals whose second derivative is an input are NaN about jumps, and wild samples of theirs are interpolated; and
    the samples of the jumps. Jumps in most periods of a motion are those of the drive, and stay."""
    out, found = dict(signals), set[int]()
    moved = {one.of for jet in made.inputs for one in jets(model.opaque.get(jet, jet)) if one.order == 2}
    for name in sorted(moved):
        x, missing = signals[name], np.isnan(signals[name])
        period = round(float(np.clip(rate / slow_hz, 8, max(8, len(x)))))  # a guess may have one beyond the recording
        whole = np.where(breaks(x, period, model.signal(name).sd), np.nan, x)
        bridge(whole, rate)
        firsts, _ = stretches(np.isnan(whole) & ~missing)
        if len(firsts) <= len(x) / rate * slow_hz / 2:
            out[name] = whole
            found |= set(firsts.tolist())
    return out, sorted(found)


def drive_edge_hz(y: Float, rate: float, noise: float) -> float:
    """Up to where the spectrum of a signal's longest stretch stands above its noise [Hz]: of the sensor, or of the
    spectrum's upper half, where instants of sampling that jitter make more.

    Parameters
    ----------
    noise : standard deviation of a sample
    """
    y = y[longest_stretch(np.isfinite(y))]
    n = len(y)
    window = np.hanning(n)
    spectrum = np.abs(np.fft.rfft((y - y.mean()) * window)) ** 2
    floor = noise**2 * float(np.sum(window**2))
    hz = np.fft.rfftfreq(n, 1 / rate)
    floor = max(floor, float(np.median(spectrum[hz >= rate / 4])) / np.log(2))  # the mean, of white noise
    weighted = spectrum * hz**4
    shown = spectrum > 30 * floor
    above = np.flatnonzero(shown & (weighted > 1e-5 * weighted[shown].sum()))
    return float(hz[above[-1]]) if len(above) else 0.0


def inputs_of(
    model: CompiledModel, made: RefineFunctions, signals: Mapping[str, Float], rate: float, sub: int
) -> tuple[Float, Float]:
    """u [steps, 3, inputs] from recorded signals, and zeros in place of their rates; NaN where a signal is missing, or
    too near for a derivative.

    Raises PvidError for an input that is another derivative than the second of a recorded signal.
    """
    steps = sub * len(signals[made.outputs[0]])
    u = np.empty((steps, 3, len(made.inputs)))
    for k, jet in enumerate(made.inputs):
        u[..., k] = _input(model, jet, signals, rate, sub)
    return u, np.zeros_like(u)


def _input(model: CompiledModel, jet: Jet, signals: Mapping[str, Float], rate: float, sub: int) -> Float:
    if jet in model.opaque:
        value = model.with_knowns(model.opaque[jet])
        through = smooth if any(one.order for one in jets(value)) else straight
        return through(_computed(model, value, signals, rate), sub)
    if jet.order == 2 and model.signal(jet.of).hold != "zoh":
        return smooth(second_derivative_of(signals[jet.of], rate, model.signal(jet.of).sd), sub)
    if jet.order > 0:
        raise _refused(model, jet)
    if model.signal(jet.of).hold == "zoh":
        return held(signals[jet.of], sub)
    return smooth(signals[jet.of], sub)


def _refused(model: CompiledModel, jet: Jet) -> PvidError:
    return PvidError(f"the second stage needs recorded inputs; {model.name} has the derivative of {jet.of} as one")


def _running(x: Float, is_held: bool) -> Float:
    """Sums from the first sample on [n]: of a held signal of its values, else by the trapezoid rule."""
    return np.concatenate([[0.0], np.cumsum(x[:-1] if is_held else (x[1:] + x[:-1]) / 2)])


def _computed(model: CompiledModel, value: sp.Expr, signals: Mapping[str, Float], rate: float) -> Float:
    """A defined signal at the samples; integrals in it begin at the first one, and at the first of each recording of a
    run (pvid.rig.run.NUMBER)."""
    size = len(next(iter(signals.values())))
    values: dict[sp.Symbol, Float] = {}
    for one in sorted(value.atoms(Integral), key=str):
        x, fold = _computed(model, one.args[0], signals, rate), int(one.args[1])
        is_held = all(model.signal(jet.of).hold == "zoh" for jet in jets(one.args[0]))
        number = signals.get(NUMBER, np.zeros(size))
        begins = np.append(np.flatnonzero(np.diff(number, prepend=-1.0)), size)
        for k in range(fold):
            x = (
                np.concatenate([_running(x[one:end], is_held and k == 0) for one, end in pairwise(begins.tolist())])
                / rate
            )
        mark = sp.Dummy()
        values[mark], value = x, value.xreplace({one: mark})
    for jet in jets(value):
        if jet.order == 2:
            values[jet] = second_derivative_of(signals[jet.of], rate, model.signal(jet.of).sd)
        elif jet.order == 0:
            values[jet] = signals[jet.of]
        else:
            raise PvidError(f"the simulation needs recorded inputs; {model.name} has {jet}, a derivative, in one")
    return broadcast(evaluated(value.xreplace({one: sp.sign(one.args[0]) for one in value.atoms(sgn)}), values), size)
