"""The strong form of a described mechanism: the window of its differentiators and its settings from a recording.

Longer windows take the noise out of the derivatives, shorter ones follow the motion: noise in the regressors biases an
estimate one way, a polynomial that is too stiff the other. Both show as a change of p with the window, so the window is
the one at which this change and the scatter of the rows are least together. There the bias changes least; it need not
be small. So the standard errors contain the distance from an estimate without derivatives, that of the weak form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.strong import StrongFunctions, renamed, strong_functions_of
from pvid.configuration.shared import Shared
from pvid.design.fir import MAX_DEGREE, savitzky_golay
from pvid.model.compiled import CompiledModel
from pvid.model.strong import strong_form
from pvid.oracle.strong_described import StrongModel, StrongSettings, all_rows, residuals, standard_errors
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.shared import Cause
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfig
from pvid.settings.strong import StrongModelConfig

_STEP = 1.25  # from window to window
_LONGEST = 401  # samples of a window
_WINDOWS = 8  # that a recording has at least
_EVERY = 4  # samples from row to row in float64
_MORE = 4  # degrees of the polynomial above the highest derivative
_LEAST_DEGREE = 6
_STIFFER = 2  # degrees more, where the least degree leaves the parameters uncertain: it follows a longer window
_ENOUGH = 0.05  # largest error, relative
_DIVIDER = 8  # rows from step to step; projection, solve and folding at rows of their own
_FIVE_POINTS = (5, 4)  # taps and degree
_FLOOR = 1e-12  # of the residuals of a kind, relative to its Y


@dataclass(frozen=True)
class Fitted:
    """The estimate of all rows of a recording with one window.

    Attributes
    ----------
    taps, degree : of the window
    p : [n_p]
    noise : standard errors from the scatter of the rows [n_p]
    change : largest change of p to the next shorter and the next longer window [n_p]
    bias : p less that of the weak form, where it has one; else 0 [n_p]
    """

    taps: int
    degree: int
    p: Float
    noise: Float
    change: Float
    bias: Float

    @property
    def shared(self) -> Float:
        """What no row shows [n_p]."""
        return np.hypot(self.change, self.bias)

    @property
    def error(self) -> Float:
        """By the scatter and the change [n_p]."""
        return np.hypot(self.noise, self.change)


@dataclass(frozen=True, eq=False)
class StrongDesign:
    """What a recording is identified with.

    Attributes
    ----------
    strong : functions of the strong form, named NAME_strong
    config : settings in float32
    fitted : the estimate in float64 with the same window
    shared : errors that no row shows
    samples : of the recording, float32 [ticks, signals]
    """

    strong: StrongFunctions
    config: StrongModelConfig
    fitted: Fitted
    shared: Shared
    samples: npt.NDArray[np.float32]


def strong_design(
    model: CompiledModel, recording: Recording, law: Law = Law.STATIONARY, reference: Float | None = None
) -> StrongDesign:
    """Window and settings for a recording without missing samples.

    Raises PvidError where the recording is too short, or the strong form of the model needs what the core does not
    have.

    Parameters
    ----------
    reference : p of the weak form, or the truth of a simulation; NaN where there is none [n_p]
    """
    strong = renamed(strong_functions_of(strong_form(model)))
    oracle = StrongModel(model)
    least = min(max(oracle.order + _MORE, _LEAST_DEGREE), MAX_DEGREE)
    tried: list[Fitted] = []
    for degree in range(least, MAX_DEGREE + 1, _STIFFER):
        tried += _compared(list(_fits(oracle, recording, degree)))
        best = _best(tried, oracle.parameters)
        if best is None or _errors(best, oracle.parameters).max() < _ENOUGH:
            break
    if best is None:
        raise PvidError(f"{len(recording)} samples are too few for derivatives of order {oracle.order}")
    if reference is not None:
        best = replace(best, bias=np.nan_to_num(best.p - reference))
    return _designed(strong, oracle, recording, best, law)


def reference_of(found: Identified | None) -> Float | None:
    """What the errors of the strong form are measured by: p of the weak form, NaN where it determines none [n_p]."""
    return (
        None if found is None else np.where([one.status == "not_identified" for one in found.judged], np.nan, found.p)
    )


def five_point_design(model: CompiledModel, recording: Recording) -> StrongDesign:
    """The same with central differences of five points, for a recording whose noise they bear: no ring is shorter.

    Raises PvidError as `strong_design`.
    """
    strong = renamed(strong_functions_of(strong_form(model)))
    oracle = StrongModel(model)
    rows = oracle.rows(recording.signals, recording.sample_rate, StrongSettings(*_FIVE_POINTS, 1))
    p, weights = all_rows(oracle.parameters, rows, oracle.parameters.checked(None))
    noise = standard_errors(oracle.parameters, rows, p, weights, _FIVE_POINTS[0])
    return _designed(strong, oracle, recording, Fitted(*_FIVE_POINTS, p, noise, *np.zeros((2, len(p)))), Law.STATIONARY)


def _designed(
    strong: StrongFunctions, oracle: StrongModel, recording: Recording, fitted: Fitted, law: Law
) -> StrongDesign:
    samples = np.stack([np.asarray(recording.signals[one.name], np.float32) for one in strong.signals], axis=1)
    sd = _residual_sd(oracle, recording, fitted)
    causes = [Cause("another window", fitted.change), Cause("the weak form", fitted.bias)]
    shared = Shared.of(fitted.p, oracle.parameters.positive, causes)
    config = _config(oracle.parameters, recording.sample_rate, fitted, law, sd)
    return StrongDesign(strong, replace(config, shared=shared.triangle), fitted, shared, samples)


def _fits(oracle: StrongModel, recording: Recording, degree: int) -> Iterator[Fitted]:
    """With longer and longer windows, before they are compared."""
    taps = degree + 3 | 1
    at_most = min(_LONGEST, len(recording) // _WINDOWS)
    start = oracle.parameters.checked(None)
    while taps <= at_most:
        settings = StrongSettings(taps, degree, _EVERY)
        try:
            rows = oracle.rows(recording.signals, recording.sample_rate, settings)
        except PvidError:  # too few rows are left
            return
        p, weights = all_rows(oracle.parameters, rows, start)
        noise = standard_errors(oracle.parameters, rows, p, weights, max(1, -(-taps // _EVERY)))
        yield Fitted(taps, degree, p, noise, *np.zeros((2, len(p))))
        taps = max(round(_STEP * taps), taps + 2) | 1


def _compared(tried: list[Fitted]) -> list[Fitted]:
    """Each with its change; one window alone says nothing about it."""

    def change(at: int) -> Float:
        beside = tried[max(at - 1, 0) : at + 2]  # one further off has an error of its own
        return np.asarray(np.max([np.abs(other.p - tried[at].p) for other in beside], axis=0))

    return [replace(one, change=change(at)) for at, one in enumerate(tried)] if len(tried) > 1 else []


def _best(tried: list[Fitted], parameters: Parameters) -> Fitted | None:
    """The least error in the mean; where noise drives an estimate out of its range, only if all do."""

    def error(one: Fitted) -> tuple[bool, float]:
        inside = all(unknown.low <= p <= unknown.high for unknown, p in zip(unknowns, one.p, strict=True))
        return not inside, float(np.mean(np.log(_errors(one, parameters))))

    unknowns = parameters.model.unknowns
    return min(tried, key=error, default=None)


def _errors(one: Fitted, parameters: Parameters) -> Float:
    """Relative [n_p]."""
    return np.maximum(one.error / np.where(parameters.positive, np.abs(one.p), parameters.sd), 1e-300)


def _config(
    parameters: Parameters, sample_rate: float, fitted: Fitted, law: Law, row_sd: tuple[float, ...]
) -> StrongModelConfig:
    bank = savitzky_golay(fitted.taps, fitted.degree)
    start = parameters.checked(None)
    unknowns = parameters.model.unknowns
    literally = law is Law.PSEUDOVELOCITY
    estimator = EstimatorConfig(
        start=start.astype(np.float32),
        start_sd=(np.abs(parameters.unit(start)) / np.sqrt(parameters.prior(start))).astype(np.float32),
        lower=np.array([min(one.low, value) for one, value in zip(unknowns, start, strict=True)], np.float32),
        upper=np.array([max(one.high, value) for one, value in zip(unknowns, start, strict=True)], np.float32),
        row_sd=1.0,
        correlation=float(bank.half),  # rows closer than half a window share samples
        law=law,
        divider=1 if literally else _DIVIDER,
    )
    return StrongModelConfig(sample_rate, bank.weights32, bank.stride, row_sd, estimator)


def _residual_sd(oracle: StrongModel, recording: Recording, fitted: Fitted) -> tuple[float, ...]:
    """Of each kind of row with the window."""
    settings = StrongSettings(fitted.taps, fitted.degree, 1)
    rows = oracle.rows(recording.signals, recording.sample_rate, settings)
    found = []
    for e, n, theta in zip(
        residuals(oracle.parameters, rows, fitted.p), rows.regressors, oracle.parameters.theta(fitted.p), strict=True
    ):
        size = float(np.sqrt(np.mean((n * theta) ** 2))) or 1.0
        found.append(max(float(np.std(e)), _FLOOR * size))
    return tuple(found)
