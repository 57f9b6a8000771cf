"""The design of a robot's identifier in C (pvid/robot.h) from a recording: polynomials, splines, groups."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.robot import POLYNOMIAL, RobotRun
from pvid.rig.run import Recording
from pvid.settings.robot_core import RobotCoreDesign

Float = npt.NDArray[np.float64]

_SPLINES = 4  # that overlap: of degree 3
_STEPS = 5  # of an interval: their rate is 10 times the highest frequency of the test functions
_GROUP_S = 1.0  # between estimates
_NOISE = 128  # PVID_ROBOT_NOISE
_WIDE = 10.0  # of the largest parameter of a unit: standard deviation of the start


def robot_core_design(model: CompiledModel, recording: Recording) -> RobotCoreDesign:
    """For a recording: knots at twice the highest frequency of its motion's test functions.

    Raises PvidError as the analysis does, and where the rate is too low for so many joints.
    """
    run = RobotRun(model, recording.run, recording.sample_rate)
    found, n = run.design, len(run.chain.joints)
    highest = (found.functions.count // 2) / found.functions.length
    ticks = max(int(found.sample_rate / (2 * highest)), n + 2)
    decimation = max(ticks // _STEPS, 1)
    # As free_ticks and ticks_of_rows of robot_f32.c: an interval has ticks for the rows, and more for the estimate.
    free = max(decimation - 2, 1)
    interval = max(ticks // decimation, -(-(n + 3) // free))
    stages = 5 * n + (2 + min(len(model.unknowns) // 10, 2)) * len(model.unknowns) + 4
    left = interval * free - 1
    group = max(
        math.ceil(stages / (left - (2 * n if left > 2 * n else n))),
        math.ceil(_GROUP_S * found.sample_rate / (interval * decimation)),
    )
    if interval > 255 or decimation > 255:
        raise PvidError(f"{found.sample_rate:g} samples a second are too many for so slow a motion: record fewer")
    half, rate, steps, samples = found.taps // 2 + 1, found.sample_rate, interval, interval * decimation
    b, slope = _spline(np.arange(_SPLINES * steps) / steps)
    ages = np.arange(_SPLINES * samples) / samples
    torque = np.concatenate([_spline(ages)[0], _spline(ages + 0.5 / samples)[0]]) / decimation
    guesses = np.array([one.guess for one in model.unknowns])
    units = np.array([one.unit for one in model.unknowns])
    widest = [float(np.max(np.abs(guesses[units == one]))) or 1.0 for one in units]
    return RobotCoreDesign(
        rate, decimation, interval,
        polynomial_weights(found.taps, POLYNOMIAL, 0)[half:],
        polynomial_weights(found.taps, POLYNOMIAL, 1)[half:] * rate,
        b, -slope * rate / samples, torque, _noise(found.taps, rate, decimation), found.sd, _whitening(b, steps),
        guesses, _WIDE * np.array(widest), group,
    )  # fmt: skip


def _spline(u: Float) -> tuple[Float, Float]:
    """The cubic B-spline on 0..4, and its derivative."""
    powers = {k: [np.maximum(u - j, 0.0) ** k for j in range(_SPLINES + 1)] for k in (2, 3)}
    factors = [(-1.0) ** j * math.comb(_SPLINES, j) for j in range(_SPLINES + 1)]
    b, slope = (sum(f * one for f, one in zip(factors, powers[k], strict=True)) / math.factorial(k) for k in (3, 2))
    return np.asarray(b), np.asarray(slope)


def _noise(taps: int, rate: float, decimation: int) -> Float:
    """One period of white noise with sd 1, whose spectrum is flat, behind the polynomials of q and v, at the steps,
    with exactly their mean square."""
    size = _NOISE * decimation
    phases = np.random.default_rng(0).uniform(0, 2 * math.pi, size // 2 + 1)
    phases[[0, -1]] = 0.0
    white = math.sqrt(size) * np.exp(1j * phases)
    gains = [np.zeros(size), np.zeros(size)]
    for order, gain in enumerate(gains):
        np.add.at(gain, np.arange(-(taps // 2), taps // 2 + 1) % size, polynomial_weights(taps, POLYNOMIAL, order))
    passed = [np.fft.irfft(white * np.conj(np.fft.rfft(gain)), size)[::decimation] for gain in gains]
    passed = [one * np.linalg.norm(gain) / np.sqrt(np.mean(one**2)) for one, gain in zip(passed, gains, strict=True)]
    return np.concatenate([passed[0], passed[1] * rate])


def _whitening(b: Float, steps: int) -> Float:
    """w of the recursion that makes rows white whose noise has the covariance of overlapping splines: what a long
    Cholesky factor of it converges to."""
    size = 20 * _SPLINES
    lags = [float(b[: len(b) - k * steps] @ b[k * steps :]) for k in range(_SPLINES)]
    covariance = sum(np.eye(size, k=k) * lags[abs(k)] for k in range(1 - _SPLINES, _SPLINES))
    last = np.linalg.cholesky(np.asarray(covariance))[-1, -_SPLINES:][::-1]
    return np.asarray(np.concatenate([[1.0], -last[1:]]) / last[0])
