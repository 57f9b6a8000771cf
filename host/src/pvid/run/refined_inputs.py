"""What the refinement is driven by and fitted to: inputs at the steps of the integration, readings at the samples."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pvid.codegen.refine import RefineFunctions
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Integral, Jet, jets

Float = npt.NDArray[np.float64]


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


def inputs_of(
    model: CompiledModel, made: RefineFunctions, signals: Mapping[str, Float], rate: float, sub: int
) -> tuple[Float, Float]:
    """u [steps, 3, inputs] from recorded signals, none of them a derivative, and zeros in place of their rates."""
    u = np.ascontiguousarray(np.stack([_input(model, jet, signals, rate, sub) for jet in made.inputs], -1))
    return u, np.zeros_like(u)


def _input(model: CompiledModel, jet: Jet, signals: Mapping[str, Float], rate: float, sub: int) -> Float:
    if jet in model.opaque:
        value = model.opaque[jet]
        assert value.func is Integral and jets(value.args[0]) == {value.args[0]}, value
        signal = model.signal(value.args[0].of)
        x = signals[signal.name]
        if signal.hold == "zoh":
            total = np.concatenate([[0.0], np.cumsum(x)[:-1]]) / rate
        else:
            total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2)]) / rate
        return straight(total, sub)
    signal = model.signal(jet.of)
    if signal.hold == "zoh":
        return held(signals[jet.of], sub)
    return smooth(signals[jet.of], sub)
