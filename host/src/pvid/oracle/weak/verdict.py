"""Is an estimate to be trusted? Each doubt has a name and a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.rounding import percent
from pvid.base.wording import listed, with_unit
from pvid.model.compiled import CompiledModel, Unknown
from pvid.oracle.weak.errors import Uncertainty, uncertainty
from pvid.oracle.weak.failures import FAILURES, Found, attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import UNKNOWN, Parameters
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import Fit, Moments, compensated, gauss_newton, inverse, normal
from pvid.oracle.weak.words import WIDE, Word, worst
from pvid.oracle.weak.zero import upper_bound

Name = Literal[
    "not_identified",
    "undetermined",
    "near_zero",
    "not_settled",
    "chi2",
    "halves",
    "windows",
    "smoothing",
    "attenuation",
    "feedback",
    "short",
    "left_out",
    "range",
    "clipped",
    "resting",
    "counts",
    "rate",
    "guesses",
    "sensor",
    "friction",
    "scale",
    "weights",
    "missing",
    "unexplained",
    "model_error",
    "wide",
    "misfit",
    "core",
    "held",
    "prediction",
    "unpredicted",
    "unchecked",
    "noise",
    "refined",
    "skew",
]
Status = Literal["good", "warning", "not_identified"]
ParameterStatus = Literal["identified", "near_zero", "not_identified"]

# Of another parameter: part of its range.
_UNKNOWN_OF_RANGE = 0.5
_COLLAPSED = 1e-6  # of its guess, or its inverse: a value that no mechanism has, whatever its error
_NEXT_TO_0 = 1e-3  # of its guess: a value and an error of it that mean 0
_TIED = 0.98  # correlation of two that are determined up to a common factor

# Two estimates disagree if they differ by so many standard errors of the difference ...
_CLASH = 4.0
# ... and by this part of the value, so that a rig whose noise is tiny is not blamed for what nobody sees.
_VISIBLE = 1e-3

# Residuals above this many times what the sensors explain are reported.
_CHI2 = 2.0
_CHI2_OF_DRIFT = 10.0  # ... and above this many make what drifts doubtful

_FEW_WINDOWS = 8

# What a reason leaves of a value, where its alarm alone does not tell it.
_LEAVES: dict[Name, Word] = {
    "not_identified": "not_identified",
    "undetermined": "not_identified",
    "unexplained": "not_explained",
    "model_error": "not_explained",
    "unpredicted": "not_explained",
    "counts": "not_explained",
    "wide": "usable",
}

# R^2 of a run of which a bound of a parameter is no doubt.
_EXPLAINED = 0.9

_RAN_AWAY = (
    "the search for the parameters ran away: the equations may not describe this run, or a signal may have another "
    "unit, sign or name"
)
_UNSETTLED = "the iteration for the parameters did not converge"


@dataclass(frozen=True)
class Reason:
    """A doubt.

    Attributes
    ----------
    name : for programs
    text : a sentence
    alarm : the standard errors may not cover it
    of : the parameters that it concerns; (): all
    """

    name: Name
    text: str
    alarm: bool = True
    of: tuple[str, ...] = ()

    @property
    def leaves(self) -> Word:
        """The best word for the values that it concerns."""
        return _LEAVES.get(self.name, "usable" if self.alarm else "good")


@dataclass(frozen=True)
class Judged:
    """Whether a run determines a parameter.

    Attributes
    ----------
    status : "near_zero": it is smaller than the run shows, and `below` bounds it
    reason : a clause, of what is not identified or near 0; else None
    below : with 95 % [unit of the parameter]
    has_error : of what is not identified: whether its standard error is one, which is only too large
    """

    status: ParameterStatus = "identified"
    reason: str | None = None
    below: float | None = None
    has_error: bool = False


@dataclass(frozen=True)
class Verdict:
    """Whether p may be used.

    Attributes
    ----------
    reasons : doubts, the gravest first
    """

    reasons: tuple[Reason, ...] = ()

    @property
    def identified(self) -> bool:
        """At least one parameter has a value that means something."""
        return not any(one.name == "not_identified" for one in self.reasons)

    def of(self, name: str) -> Word:
        """Of one parameter."""
        return worst(one.leaves for one in self.reasons if not one.of or name in one.of)

    @property
    def word(self) -> Word:
        """Of the answer: what concerns some parameters alone leaves the others usable."""
        return worst("usable" if one.of and one.leaves != "good" else one.leaves for one in self.reasons)

    @property
    def status(self) -> Status:
        """For programs: whether there is a value, and a warning."""
        if not self.identified:
            return "not_identified"
        return "warning" if any(one.alarm for one in self.reasons) else "good"

    @property
    def warning(self) -> str | None:
        """The alarms in plain sentences; None: there is none."""
        return " ".join(one.text for one in self.reasons if one.alarm) or None


@dataclass(frozen=True)
class Halves:
    """Estimates from the windows of each half of a run, and how they differ [n_p] in their standard errors."""

    first: Float
    second: Float
    clash: Float


def judged(model: CompiledModel, fit: Fit, se: Float) -> list[Judged]:
    """Of each parameter whether the run determines it.

    Parameters
    ----------
    se : standard errors [n_p], those that are published where there are such
    """
    if fit.diverged:
        return [Judged("not_identified", _RAN_AWAY)] * len(fit.p)
    parameters = fit.parameters
    out = []
    for k, one in enumerate(model.unknowns):
        if one.symbol in model.anchors:  # what is known of it is not the run's
            out.append(Judged())
            continue
        p, limit = float(fit.p[k]), UNKNOWN * abs(float(fit.p[k]))
        own_scale = one.positive and not parameters.positive[k]
        if not one.positive or own_scale:  # an offset of exactly 0 has an error all the same
            limit = max(limit if own_scale else 0.0, _UNKNOWN_OF_RANGE * float(parameters.sd[k]))
        if p in (parameters.low[k], parameters.high[k]):
            side, bound = ("low", one.bounds[0]) if p == parameters.low[k] else ("high", one.bounds[1])
            out.append(
                Judged("not_identified", f"{one.name} is at its bound, {side} = {with_unit(bound, one.unit, 4)}")
            )
        elif not se[k] <= limit or one.positive and _is_lost(p / one.guess) and not own_scale:
            ran_down = one.positive and max(p, float(se[k])) < _NEXT_TO_0 * one.guess
            why = (
                "the search takes {} to 0"
                if ran_down
                else f"the standard error of {{}} is {with_unit(se[k], one.unit, 2)}, "
                f"beside a value of {with_unit(p, one.unit, 2)}"
            )
            if se[k] <= limit:
                value = with_unit(p, one.unit, 2)
                far = "below a millionth of" if p < one.guess else "above a million times"
                why = f"{{}} would be {value}, {far} its guess: is that in another unit?"
            has_error = not ran_down and bool(np.isfinite(se[k]))
            out.append(Judged("not_identified", why.format(one.name), has_error=has_error))
        elif own_scale and se[k] > UNKNOWN * abs(p):
            out.append(_near_zero(one, p, float(se[k])))
        else:
            out.append(Judged())
    known = [one.status == "identified" for one in out]
    if not any(known):  # all at 0: the equations do not describe the run
        return [replace(one, status="not_identified") for one in out]
    return _without_scale(model, fit, out)


def _is_lost(of_guess: float) -> bool:
    return not _COLLAPSED <= of_guess <= 1 / _COLLAPSED


def _without_scale(model: CompiledModel, fit: Fit, found: Sequence[Judged]) -> list[Judged]:
    """What may be 0 has no bound where it grows together with what is not determined: their common scale is free."""
    out = list(found)
    lost = [k for k, one in enumerate(out) if one.status == "not_identified"]
    small = [k for k, one in enumerate(out) if one.status == "near_zero"]
    covariance = attempted(lambda: uncertainty(fit).covariance) if lost and small else None
    if covariance is None:
        return out
    sd = np.sqrt(np.diag(covariance))
    for k in small:
        tied = [one for one in lost if covariance[k, one] > _TIED * sd[k] * sd[one]]
        if tied:
            other = model.unknowns[tied[0]].name
            out[k] = Judged("not_identified", f"{model.unknowns[k].name} and {other} grow together", has_error=True)
    return out


def _near_zero(unknown: Unknown, p: float, se: float) -> Judged:
    below = upper_bound(p, se)
    return Judged("near_zero", f"{unknown.name} is below {with_unit(below, unknown.unit, 2)} with 95 %", below)


def judged_again(model: CompiledModel, before: Sequence[Judged], p: Float, se: Float) -> tuple[Judged, ...]:
    """What may be 0, by a further estimate [n_p] with its standard errors; the others as before."""
    out = list(before)
    for k, one in enumerate(before):
        if one.status == "near_zero":
            out[k] = _near_zero(model.unknowns[k], p[k], se[k]) if se[k] > UNKNOWN * abs(p[k]) else Judged()
    return tuple(out)


def with_unsettled(fit: Fit, found: Sequence[Judged]) -> list[Judged]:
    """The same of an answer: where the search did not come to rest, what is not determined moves the others."""
    if fit.settled or all(one.status != "not_identified" for one in found):
        return list(found)
    return [replace(one, status="not_identified", reason=one.reason or _UNSETTLED) for one in found]


def is_known(model: CompiledModel, fit: Fit, small: npt.NDArray[np.bool_], se: Float) -> bool:
    """Whether every parameter has a value within its range that means something, or may be 0.

    Parameters
    ----------
    small, se : as `near_zero` gives them
    """
    missing = [one.status == "not_identified" for one in judged(model, fit, se)]
    outside = of_range(model, np.where(small, fit.parameters.guess, fit.p))
    return not outside and not np.any(missing & ~small)


def of_parameters(
    model: CompiledModel, fit: Fit, se: Float, found: Sequence[Judged], r2: Sequence[float]
) -> list[Reason]:
    """What the run does not determine, with what the worst is mixed, and what may be 0.

    Parameters
    ----------
    se, found : standard errors [n_p]; of each parameter
    r2 : of each row kind: noise in the regressors of a run that is not explained draws parameters to 0
    """
    if fit.diverged:
        return [Reason("not_identified", f"{_RAN_AWAY[0].upper()}{_RAN_AWAY[1:]}.")]
    out = []
    size = UNKNOWN * np.where(fit.parameters.positive, np.abs(fit.p), fit.parameters.sd)
    missing = [k for k in np.argsort(-np.nan_to_num(se / size, nan=np.inf)) if found[k].status == "not_identified"]
    if missing:
        partner = attempted(lambda: partner_of(fit, int(missing[0])))
        names = [model.p_names[k] for k in missing]
        text = f"The run does not determine {listed(names)}: {found[missing[0]].reason}"
        if partner is not None:
            text += f"; {names[0]} and {model.p_names[partner]} are not identifiable together"
        name: Name = "not_identified" if len(missing) == len(found) else "undetermined"
        out.append(Reason(name, f"{text}.", of=of_some(model, missing)))
    return [*out, *of_bounds(model, found, min(r2))]


def of_bounds(model: CompiledModel, found: Sequence[Judged], r2: float) -> list[Reason]:
    """What may be 0.

    Parameters
    ----------
    r2 : the least of the row kinds
    """
    small = [k for k, one in enumerate(found) if one.status == "near_zero"]
    if not small:
        return []
    bounds = listed(f"{found[k].reason}" for k in small)
    beyond = any((found[k].below or 0.0) > model.unknowns[k].guess for k in small) or r2 < _EXPLAINED
    return [Reason("near_zero", f"The run shows an upper bound alone: {bounds}.", beyond, of=of_some(model, small))]


def of_width(model: CompiledModel, fit: Fit, se: Float, by_model: Float, found: Sequence[Judged]) -> list[Reason]:
    """Values with large standard errors.

    Parameters
    ----------
    se, by_model : published standard errors, and the model's part of them [n_p]
    """
    own = np.where(fit.parameters.positive, 0.0, _UNKNOWN_OF_RANGE / UNKNOWN * fit.parameters.sd)
    size = np.maximum(np.abs(fit.p), own)
    known = np.array([one.status == "identified" for one in found])
    out = []
    lost = [int(k) for k in np.flatnonzero(known & (by_model > UNKNOWN * size))]
    if lost:
        names = listed(model.p_names[k] for k in lost)
        text = f"What the equations seem to lack may change {names} by more than {percent(UNKNOWN)}."
        out.append(Reason("model_error", text, of=of_some(model, lost)))
    known &= [one not in model.anchors for one in model.p]
    wide = [int(k) for k in np.flatnonzero(known & (se > WIDE * size)) if k not in lost]
    if wide:
        names = listed(model.p_names[k] for k in wide)
        text = f"The standard error is above {percent(WIDE)} of the value of {names}."
        out.append(Reason("wide", text, alarm=False, of=of_some(model, wide)))
    return out


def of_some(model: CompiledModel, places: Sequence[int]) -> tuple[str, ...]:
    """Names of parameters for a reason; () of all."""
    return () if len(places) == len(model.p_names) else tuple(model.p_names[k] for k in places)


def partner_of(fit: Fit, worst: int) -> int | None:
    """The parameter that compensates a change of the worst one best; None where none does much."""
    moments = Moments.of(fit.white)
    information, _ = normal(fit.parameters, moments, fit.p, moments.grouped(fit.parameters.theta(fit.p)))
    covariance = inverse(information + np.diag(fit.parameters.prior(fit.start)), fit.tangent)
    scale = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance[worst] / (scale[worst] * scale))
    correlation[worst] = 0.0
    best = int(np.argmax(correlation))
    return best if correlation[best] > 0.7 else None


def halves_of(fit: Fit) -> Halves | None:
    """The run's two halves, each from its own windows; None where there are too few. Of several recordings a half has
    one of each, as one recording may not determine what the others do."""
    if fit.rows.windows < 2 * _FEW_WINDOWS:
        return None
    parts = []
    half = fit.rows.parts(2)
    for windows in (half == 0, half == 1):
        own = fit.only(windows)
        moments = compensated(own.rows, own.white, own.parameters.theta(own.p))
        p, _ = gauss_newton(own.parameters, moments, own.p, own.parameters.prior(own.start), 30)
        moved = own.at(p)
        parts.append((p, uncertainty(moved).se))
    spread = np.hypot(parts[0][1], parts[1][1])
    return Halves(parts[0][0], parts[1][0], np.abs(parts[0][0] - parts[1][0]) / spread)


def disagreement(
    name: Name,
    model: CompiledModel,
    parameters: Parameters,
    one: Float,
    other: Float,
    clash: Float,
    text: str,
    covered: Float | float = 0.0,
) -> list[Reason]:
    """Two estimates [n_p] that are `clash` [n_p] standard errors apart disagree: a note where they are no further apart
    than what is covered.

    Parameters
    ----------
    covered : published standard errors [n_p]
    text : of the sentence, with {names} of the parameters in question, and of the first one {name}, {one} and {other}
    """
    size = np.where(parameters.positive, np.maximum(np.abs(one), np.abs(other)), parameters.sd)
    apart = np.flatnonzero((clash > _CLASH) & (np.abs(one - other) > _VISIBLE * size))
    if not len(apart):
        return []
    k = int(apart[0])
    names = listed(model.p_names[bad] for bad in apart)
    values = [with_unit(value, model.unknowns[k].unit, 4) for value in (one[k], other[k])]
    shown = text.format(names=names, name=model.p_names[k], one=values[0], other=values[1])
    alarm = bool(np.any((np.abs(one - other) > covered)[apart]))
    return [Reason(name, shown, alarm, of_some(model, [int(bad) for bad in apart]))]


def of_halves(model: CompiledModel, fit: Fit, halves: Halves | None) -> list[Reason]:
    """The halves of a run disagree."""
    if halves is None:
        return [Reason("short", "The run is too short to compare its halves.", alarm=False)]
    text = (
        "The halves of the run disagree on {names} ({name}: {one} and {other}): something changed, or the equations "
        "lack a term."
    )
    return disagreement("halves", model, fit.parameters, halves.first, halves.second, halves.clash, text)


def of_windows(
    model: CompiledModel, fit: Fit, found: Uncertainty, other: Fit, of_other: Uncertainty, se: Float
) -> list[Reason]:
    """Two lengths of window disagree."""
    lengths = [one.rows.functions.length for one in (fit, other)]
    text = (
        f"Windows of {lengths[0]:.3g} s and {lengths[1]:.3g} s disagree on {{names}} ({{name}}: {{one}} and "
        "{other}): noise in the regressors or a missing term biases the estimate."
    )
    return _of_same_samples("windows", model, fit, found, other, of_other, text, se)


def of_smoothing(
    model: CompiledModel, fit: Fit, found: Uncertainty, other: Fit, of_other: Uncertainty, se: Float
) -> list[Reason]:
    """Two lengths of the filter that gives derivatives disagree: one blurs the motion, which no residual shows."""
    taps = [one.rows.record.grid.design.rate_taps for one in (fit, other)]
    text = (
        f"Derivatives over {taps[0]} and over {taps[1]} samples disagree on {{names}} ({{name}}: {{one}} and "
        "{other}): the longer filter attenuates the motion, or the shorter one passes too much noise."
    )
    return _of_same_samples("smoothing", model, fit, found, other, of_other, text, se)


def _of_same_samples(
    name: Name,
    model: CompiledModel,
    fit: Fit,
    found: Uncertainty,
    other: Fit,
    of_other: Uncertainty,
    text: str,
    se: Float,
) -> list[Reason]:
    """Two estimates from the same samples disagree: the larger error bounds that of the difference."""
    clash = np.abs(fit.p - other.p) / np.maximum(found.se, of_other.se)
    return disagreement(name, model, fit.parameters, fit.p, other.p, clash, text, se)


def of_attenuation(model: CompiledModel, fit: Fit, found: Uncertainty, other: Float | None, se: Float) -> list[Reason]:
    """The same rows with the highest derivative as the dependent signal disagree."""
    if other is None:
        return []
    text = (
        "Motion that the equations do not explain biases {names} ({name} is {one}, and {other} with the highest "
        "derivative as the dependent signal): excite more strongly, or take longer windows and fewer functions."
    )
    clash = np.abs(fit.p - other) / found.se
    return disagreement("attenuation", model, fit.parameters, fit.p, other, clash, text, se)


def of_weights(
    model: CompiledModel, fit: Fit, found: Uncertainty, other: Fit, of_other: Uncertainty, se: Float
) -> list[Reason]:
    """The same rows, weighted by the sensors' noise alone, disagree: a note, as no residual tells which is right."""
    text = (
        "With the weights of the sensors alone (--weights sensors) {names} would differ ({name}: {other} in place of "
        "{one}): use the values that predict another run of this mechanism better."
    )
    reasons = _of_same_samples("weights", model, fit, found, other, of_other, text, se)
    return [replace(one, alarm=False) for one in reasons]


def of_residuals(model: CompiledModel, found: Uncertainty) -> list[Reason]:
    """Residuals beyond what the sensors explain: a note, as it is not their size that biases p; far beyond it an alarm
    for what drifts, as that follows whatever the equations do not explain."""
    if found.chi2 <= _CHI2:
        return []
    if model.drifts and found.chi2 > _CHI2_OF_DRIFT:
        names = [model.p_names[k] for k in model.drifting]
        text = (
            f"The residuals are {found.chi2:.3g} times what the sensors explain: something else than the drift "
            f"changed, or the equations lack a term, and {listed(names)} "
            f"{'follows' if len(names) == 1 else 'follow'} it."
        )
        return [Reason("chi2", text, of=of_some(model, model.drifting))]
    text = f"The residuals are {found.chi2:.3g} times what the sensors explain; standard errors are from their scatter."
    return [Reason("chi2", text, alarm=False)]


def of_range(model: CompiledModel, p: Float, found: Sequence[Judged] = ()) -> list[Reason]:
    """Values beyond what the model calls plausible; of what is identified. All of a circle is plausible."""
    out = [
        k
        for k, (one, value) in enumerate(zip(model.unknowns, p, strict=True))
        if one.high > one.low and not one.low <= value <= one.high and (not found or found[k].status == "identified")
        if not is_circular(model, k)
    ]
    if not out:
        return []
    values = (
        f"{one.name} = {with_unit(p[k], one.unit, 3)} ({one.low:.3g} to {with_unit(one.high, one.unit, 3)})"
        for k, one in ((k, model.unknowns[k]) for k in out)
    )
    text = f"Outside the range that the model calls plausible: {listed(values)}."
    return [Reason("range", text, of=of_some(model, out))]


def is_circular(model: CompiledModel, k: int) -> bool:
    """Whether an unknown is an angle of which every turn is the same to the equations, as the offset of an encoder
    within a sine."""
    one = model.unknowns[k]
    if one.unit != "rad":
        return False
    own = {} if model.together is None else {new: old for of in model.together.own for old, new in of.items()}
    symbol = own.get(one.symbol, one.symbol)
    having = [equation for equation in model.equations if equation.has(symbol)]
    return bool(having) and all(equation.subs(symbol, symbol + 2 * sp.pi) == equation for equation in having)


def of_spoiled(rows: WeakRows, fit: Fit) -> list[Reason]:
    """Windows that were left out of those of a run."""
    bad = np.setdiff1d(rows.numbers, fit.rows.numbers)
    if not len(bad):
        return []
    first = float(rows.end_times()[np.searchsorted(rows.numbers, bad[0])]) - rows.functions.length
    return [
        Reason(
            "left_out",
            f"{len(bad)} of {rows.windows} windows are left out, the first at {max(first, 0.0):.3g} s: their residuals "
            "are far above those of the others.",
            alarm=False,
        )
    ]


def settled(fit: Fit) -> list[Reason]:
    """The search did not come to rest."""
    return [] if fit.settled else [Reason("not_settled", "The iteration for the parameters did not converge.")]


def widened(se: Float, halves: Halves | None) -> Float:
    """Standard errors that cover half the distance of the halves where that is beyond chance."""
    if halves is None:
        return se
    apart = np.abs(halves.first - halves.second) / 2
    return np.where(apart > 2 * se, apart, se)


def sorted_by_gravity(reasons: Iterable[Reason]) -> tuple[Reason, ...]:
    """Alarms first."""
    return tuple(sorted(reasons, key=lambda one: not one.alarm))


class Attempts:
    """Computations beside the fit. Those whose numbers run away are named in one warning: they may have had one."""

    def __init__(self) -> None:
        self._without: list[str] = []

    def __call__(self, what: str, computation: Callable[[], Found]) -> Found | None:
        try:
            return computation()
        except FAILURES:
            self._without.append(what)
            return None

    def reasons(self, checks: Mapping[str, Callable[[], list[Reason]]]) -> list[Reason]:
        """Of all checks, by what they look at."""
        return [one for what, check in checks.items() for one in self(what, check) or []]

    @property
    def failed(self) -> list[Reason]:
        """The warning."""
        if not self._without:
            return []
        what = listed(dict.fromkeys(self._without))
        return [Reason("unchecked", f"Not checked, because the numbers ran away: {what}.")]
