"""What the refinement is driven by and fitted to: inputs at the steps of the integration, readings at the samples."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.codegen.refine import RefineFunctions
from pvid.design.second_derivative import second_derivative
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Integral, Jet, jets, sgn
from pvid.oracle.weak.channels import broadcast, evaluated
from pvid.rig.gaps import longest_stretch, stretches
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]

EDGE = 1.25  # times the drive's: the pass band
HIGHEST = 0.25  # of the sample rate: a pass band that its filter is exact in to 1e-5
_FEWEST = 12  # values of a second derivative: its spline is of order five


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
    from scipy.interpolate import make_interp_spline  # takes a quarter of a second

    out = np.full(len(x), np.nan)
    edge = min(EDGE * drive_edge_hz(x, rate, noise), HIGHEST * rate)
    if edge <= 0:
        return out
    front = second_derivative(rate, edge)
    for first, end in zip(*stretches(np.isfinite(x)), strict=True):
        if end - first < front.mean * (2 * front.half + _FEWEST):
            continue
        times, found = front.apply(x[first:end], rate)
        at = np.arange(int(np.ceil(times[0] * rate)), int(times[-1] * rate) + 1)
        out[first + at] = make_interp_spline(times, found, k=5)(at / rate)
    return out


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

    Raises
    ------
    PvidError
        For an input that is another derivative than the second of a recorded signal.
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
    if jet.order > 0:
        raise PvidError(f"the second stage needs recorded inputs; {model.name} has the derivative of {jet.of} as one")
    if model.signal(jet.of).hold == "zoh":
        return held(signals[jet.of], sub)
    return smooth(signals[jet.of], sub)


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
