"""From a compiled model and a recorded run to parameters, standard errors and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.model.drifted import Drifted
from pvid.oracle.weak import shared, verdict, work
from pvid.oracle.weak.assessment import Assessed, assessed, estimated_near_zero
from pvid.oracle.weak.attenuation import other_line
from pvid.oracle.weak.blur import shift_of
from pvid.oracle.weak.choice import NOISE, Scored, basis_of, ranked
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.drift import with_drift
from pvid.oracle.weak.edges import other_side
from pvid.oracle.weak.errors import chi2_of_sensors, uncertainty
from pvid.oracle.weak.failures import FAILURES, attempted
from pvid.oracle.weak.feedback import of_feedback
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.library import Library
from pvid.oracle.weak.missing import MOST, Explained, Missing, explained
from pvid.oracle.weak.naming import of_missing, of_unexplained
from pvid.oracle.weak.rows import Compiled, EquationError, WeakRows, record_of
from pvid.oracle.weak.rows import ready as ready
from pvid.oracle.weak.samples import explains, of_samples
from pvid.oracle.weak.scale import of_scale
from pvid.oracle.weak.shared import Cause, or_nan
from pvid.oracle.weak.solve import COMPARED, PASSES_COMPARED, DivergedError, Fit, batch, online
from pvid.oracle.weak.verdict import Attempts, Halves, Judged, Reason, Verdict
from pvid.oracle.weak.weights import Weights, as_white_force


@dataclass(frozen=True)
class Identified:
    """What a run says about a mechanism.

    Attributes
    ----------
    names, units : of the parameters
    p : [n_p]
    se : published standard errors, those of gains included [n_p]
    by_gain : of each signal but angles, what p is off by over the error of its gain [n_p]
    by_clock : what p is off by over the relative error of the sample rate, 0 where the model has none [n_p]
    causes : of the scale part: constants, gains and the clock that have a standard deviation, neglected terms
    by_model : what p may be off by because the equations lack something, or a signal is not what was recorded [n_p]
    lacking : what the equations seem to lack; None: the numbers of the test ran away
    named : the terms that explain it; None: none does, or what is lacking is small or has another cause
    shifts : what p may be off by that way, and how far other estimates are [terms, n_p]
    predicted, clustered : those from the sensors and the equations' errors; from the scatter of the windows [n_p]
    covariance : of p, that of `predicted` [n_p, n_p]
    chi2 : mean square of the residuals over what the sensors alone explain
    verdict : whether to trust it
    judged : whether the run determines it, of each parameter
    r2 : of each row kind
    times : end of each window [s]
    design : of the windows
    equation_errors : of each row kind
    with_error : they were estimated
    halves : p of either half; None: too short
    fit : rows and residuals, for plots
    ranking : designs that were tried, the best first; () where the design was given
    allowance : units of work that the search for a design may do
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    p: Float
    se: Float
    predicted: Float
    clustered: Float
    covariance: Float
    chi2: float
    verdict: Verdict
    judged: tuple[Judged, ...]
    r2: dict[str, float]
    times: Float
    design: WeakDesign
    equation_errors: dict[str, EquationError]
    with_error: bool
    halves: Halves | None
    fit: Fit
    ranking: tuple[Scored, ...]
    allowance: float
    by_gain: dict[str, Float]
    by_clock: Float
    causes: tuple[Cause, ...]
    by_model: Float
    lacking: Missing | None
    named: Explained | None
    shifts: Float

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """name -> (value, standard error)."""
        return {name: (float(p), float(se)) for name, p, se in zip(self.names, self.p, self.se, strict=True)}

    @property
    def drifted(self) -> Drifted | None:
        """How p drifted during the run; None: nothing drifts."""
        return self.fit.rows.compiled.bare.drifted

    @property
    def gains(self) -> Float:
        """What p is off by for one standard deviation of each of the causes [causes, n_p]."""
        return np.array([one.moves for one in self.causes])

    @property
    def by_neglect(self) -> Float:
        """What p may be off by because equations are linearised [n_p]."""
        return self.causes[-1].moves

    @property
    def noise(self) -> Float:
        """The published standard errors but for gains, constants and what is missing [n_p]."""
        other = np.sum(self.gains**2, axis=0) + self.by_model**2
        return np.asarray(np.sqrt(np.maximum(self.se**2 - other, 0.0)))

    @cached_property
    @np.errstate(all="ignore")
    def history(self) -> Float:
        """p after each window of the fit, from the windows up to it [n, n_p]; NaN where the search ran away."""
        if self.drifted is not None:
            return self.drifted.told_at(self.times)  # the last fit may leave out other windows
        return online(self.fit.rows, self.fit.start, self.with_error)

    @property
    def history_times(self) -> Float:
        """Ends of these windows [n, s], which are not `times` where another fit than the usual is published."""
        return self.times if self.drifted is not None else self.fit.rows.end_times()


_SHORTER = 0.7  # of the samples of a derivative: what blurs falls to a quarter or less

_NOT_REWEIGHTED = (
    "The rows, weighted anew by their own residuals, lead from estimate to estimate without an end: the values are "
    "those of the sensors' weights alone (--weights sensors)."
)

_NOT_FOLLOWED = "The drift cannot be followed: values and reasons are those of parameters that do not drift."

# Of the work that is allowed to the search for a design: that of the rest where it finds a plausible estimate, terms
# that are missing included, where it finds none, and where the equations explain nothing of a row.
_OF_KNOWN, _OF_UNKNOWN, _OF_HOPELESS = 1.5, 0.8, 0.1


def allowance_of(model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float) -> float:
    """Units of work that the search for a design of a run may do."""
    columns = sum(len(row.theta) + 1 for row in model.rows)
    samples, reversals = max(np.size(one) for one in run.values()), 0
    if ready(model).channels.signs:
        record = attempted(lambda: record_of(ready(model), run, basis_of(ready(model), sample_rate)))
        reversals = 0 if record is None else sum(one.reversals for one in record.signs)
    return work.allowance(len(model.rows), columns, reversals, samples)


def start_of(model: CompiledModel, start: Mapping[str, float] | npt.ArrayLike | None) -> Float | None:
    """A start as an array; names that a mapping leaves out start at their guess."""
    if start is None:
        return None
    if isinstance(start, Mapping):
        unknown = [name for name in start if name not in model.p_names]
        if unknown:
            raise PvidError(f"{model.name} has no unknown {unknown[0]}; its unknowns are {', '.join(model.p_names)}")
        return np.array([float(start.get(one.name, one.guess)) for one in model.unknowns])
    return np.asarray(start, np.float64)


def identify(
    compiled: CompiledModel,
    run: Mapping[str, npt.ArrayLike],
    sample_rate: float,
    start: Mapping[str, float] | npt.ArrayLike | None = None,
    design: WeakDesign | None = None,
    compensate: bool = True,
    weights: Weights = "residuals",
) -> Identified:
    """Parameters of a mechanism from a run.

    Parameters
    ----------
    run : name of each signal -> samples [n], in the model's units
    sample_rate : [Hz]
    start : of p, by name or in order; the guesses of the model where none is given
    design : None: chosen by predicted errors and chi^2 on this run
    compensate : take the bias of noisy regressors off
    weights : "residuals": of the sensors and an error of the equations, estimated from the residuals; "sensors": of the
        sensors alone
    """
    begun = start_of(compiled, start)
    with_error = weights == "residuals"
    units = allowance_of(compiled, run, sample_rate)
    ranking: tuple[Scored, ...] = ()
    for _ in range(2 if compiled.drifts else 1):  # designs are compared anew in rows without the drift
        if design is None:
            with work.limited(units):
                ranking = tuple(ranked(ready(compiled), run, sample_rate, begun, with_error))
        used = ranking[0].design if design is None else design
        if compiled.drifts and (followed := attempted(partial(with_drift, compiled, run, used, begun, with_error))):
            compiled, begun = followed
        elif compiled.drifts:
            stays = replace(compiled, drifts=(), drifted=None)
            found = identify(stays, run, sample_rate, start, design, compensate, weights)
            reasons = (*found.verdict.reasons, Reason("not_settled", _NOT_FOLLOWED))
            return replace(found, verdict=Verdict(verdict.sorted_by_gravity(reasons)))
    if not ranking:
        return _judged(compiled, run, used, begun, None, compensate, with_error, units)
    share = _OF_HOPELESS if ranking[0].is_hopeless else _OF_KNOWN if ranking[0].known else _OF_UNKNOWN
    with work.limited(share * units):
        return _judged(compiled, run, used, begun, ranking[0].p, compensate, with_error, units, ranking)


def _judged(
    compiled: CompiledModel,
    run: Mapping[str, npt.ArrayLike],
    used: WeakDesign,
    begun: Float | None,
    near: Float | None,
    compensate: bool,
    with_error: bool,
    units: float,
    ranking: tuple[Scored, ...] = (),
) -> Identified:
    """The estimate by a design, with all its checks.

    Parameters
    ----------
    begun, near : starts of the search for p, `near` where the other leads nowhere; None: the guesses, none
    """
    model, sample_rate = ready(compiled), used.sample_rate
    rows = WeakRows.of(model, run, used)
    own = assessed(_estimated(rows, begun, with_error, compensate))
    first = own.fit
    if near is not None and not own.is_found:  # the guesses lead elsewhere
        other = replace(_estimated(rows, near, with_error, compensate), start=first.start)
        own = own if other.diverged and not first.diverged else assessed(other)
    weighted_anew = with_error
    if with_error and not own.fit.settled:
        alone = assessed(replace(_estimated(rows, near, False, compensate), start=first.start))
        if alone.is_found:
            own, weighted_anew = alone, False
    own = estimated_near_zero(own, weighted_anew, compensate)
    if own.fit.rows.windows < rows.windows and own.found.chi2 < NOISE:
        own = attempted(lambda: _of_all_windows(run, used, rows, own, weighted_anew, compensate)) or own
    fit, found = own.fit, own.found
    attempt = Attempts()
    halves = attempt("the halves of the run", lambda: verdict.halves_of(fit))
    white = attempt("a white force as the error of the equations", lambda: as_white_force(fit))
    library = Library(run, used, fit)
    side = attempt("the other side of jumps", lambda: other_side(compiled, run, sample_rate))
    blurred = attempt("rates that the filter blurs", lambda: shift_of(fit, run, used))
    by_gain = {
        one.name: or_nan(fit, partial(library.by_gain, one.name))
        for one in compiled.signals
        if one.gain_sd > 0 or one.unit != "rad"
    }
    by_clock = or_nan(fit, lambda: library.by_clock) if compiled.clock_sd else np.zeros(len(fit.p))
    causes = tuple(shared.of_scale(library))
    parts = [
        verdict.widened(found.se, halves),
        *(one.moves for one in causes),
        *([] if blurred is None else [blurred]),
        *([] if side is None else [side]),
        *([] if white is None else [white - fit.p]),
    ]
    se = np.sqrt(np.sum(np.square(parts), axis=0))
    judged = tuple(verdict.with_unsettled(fit, verdict.judged(compiled, fit, se)))
    reasons = verdict.of_parameters(compiled, fit, se, judged, found.r2)
    named: Explained | None = None
    lacking = None if fit.diverged else attempt("what is missing", lambda: Missing.of(library, se))
    if not fit.diverged:
        reasons += attempt.reasons(_checks(rows, run, own, halves, judged, with_error, se))
        if (
            lacking is not None
            and (lacking.visible.any() or lacking.is_large)
            and not explains(reasons, lacking.there[0], sample_rate)
        ):
            named = attempt("what is missing", partial(explained, library, lacking))
            if named is not None and not lacking.visible.any() and named.share < MOST:
                named = None  # what moves nothing is named where the name is sure
            if named is not None and any(one.name == "halves" for one in reasons):
                named = replace(named, complete=named.complete and _halves_agree(compiled, named.fit))
            if named is not None:
                if named.complete:  # what is named explains a time constant within a sample, too
                    reasons = [one for one in reasons if one.name != "rate"]
                    lacking = lacking.by_fit(named.fit.p)
                    for shift in (named.further.p - fit.p, *named.instead):
                        lacking = lacking.also(shift)
                lost = [k for k, one in enumerate(judged) if one.status == "not_identified"]
                reasons += of_missing(fit, lacking, named, min(found.r2), lost)
        if lacking is not None and (unknown := of_unexplained(compiled, found, lacking)):
            lacking = lacking.also(library.scores.by_parts())
            reasons += unknown
        reasons += of_scale(compiled, by_gain, fit.p, found.se)
        reasons += attempt.failed
        if with_error and not weighted_anew:
            reasons.append(Reason("not_settled", _NOT_REWEIGHTED))
    by_model = np.zeros(len(se)) if lacking is None else lacking.error
    published = np.hypot(se, by_model)
    reasons += verdict.of_width(compiled, fit, published, by_model, judged)
    return Identified(
        names=compiled.p_names,
        units=tuple(one.unit for one in compiled.unknowns),
        p=fit.p,
        se=published,
        predicted=found.predicted,
        clustered=found.clustered,
        covariance=found.covariance,
        chi2=found.chi2,
        verdict=Verdict(verdict.sorted_by_gravity(reasons)),
        judged=judged,
        r2={row.name: value for row, value in zip(compiled.rows, found.r2, strict=True)},
        times=fit.rows.end_times(),
        design=used,
        equation_errors={row.name: one for row, one in zip(compiled.rows, fit.errors, strict=True)},
        with_error=with_error,
        halves=halves,
        fit=fit,
        ranking=ranking,
        allowance=units,
        by_gain=by_gain,
        by_clock=by_clock,
        causes=causes,
        by_model=by_model,
        lacking=lacking,
        named=named,
        shifts=np.zeros((0, len(se))) if lacking is None else lacking.shifts,
    )


def _of_all_windows(
    run: Mapping[str, npt.ArrayLike],
    used: WeakDesign,
    rows: WeakRows,
    own: Assessed,
    with_error: bool,
    compensate: bool,
) -> Assessed:
    """The estimate from all windows, if a term explains all that they have beyond noise: those that were left out were
    not spoiled. `own` if none does."""
    fit = replace(batch(rows, own.fit.p, with_error, compensate), start=own.fit.start)
    library = Library(run, used, fit)
    lacking = Missing.of(library, uncertainty(fit).se)
    if not lacking.is_large:
        return own
    named = explained(library, lacking)
    is_named = named.complete and (lacking.visible.any() or named.share >= MOST)
    return assessed(fit) if is_named and chi2_of_sensors(named.fit) < NOISE else own


def _estimated(rows: WeakRows, start: Float | None, equation_error: bool, compensate: bool) -> Fit:
    """The estimate; where the search runs away, the last that could be computed.

    Raises PvidError when not even the start can be.
    """
    try:
        return gated(rows, start, equation_error, compensate)
    except DivergedError as error:
        return error.fit
    except FAILURES as error:
        name = rows.compiled.model.name
        raise PvidError(
            f"the equations of {name} give numbers beyond all bounds at the guesses: is a signal in another unit?"
        ) from error


def _checks(
    rows: WeakRows,
    run: Mapping[str, npt.ArrayLike],
    own: Assessed,
    halves: Halves | None,
    judged: Sequence[Judged],
    equation_error: bool,
    se: Float,
) -> dict[str, Callable[[], list[Reason]]]:
    """Every check of an estimate, by what it looks at."""
    fit, found = own.fit, own.found
    model, design = fit.rows.compiled, rows.record.grid.design
    bare = model.bare

    def compared(judge: Callable[..., list[Reason]], fitted: Callable[[], Fit | None]) -> list[Reason]:
        other = None if work.is_spent() else fitted()  # no fit is compared with one that was ended
        return [] if other is None else judge(bare, fit, found, other, uncertainty(other), se)

    return {
        "the search": lambda: verdict.settled(fit),
        "the samples": lambda: of_samples(bare, run, design.sample_rate, fit, min(found.r2)),
        "the halves of the run": lambda: verdict.of_halves(bare, fit, halves),
        "attenuation": lambda: verdict.of_attenuation(bare, fit, found, other_line(fit), se),
        "feedback": lambda: of_feedback(bare, run, fit, own.known),
        "the residuals": lambda: verdict.of_residuals(bare, found),
        "the range": lambda: verdict.of_range(bare, fit.p, judged),
        "spoiled windows": lambda: verdict.of_spoiled(rows, fit),
        "the weights of the sensors": lambda: compared(verdict.of_weights, partial(by_sensors, fit)),
        "windows of another length": lambda: compared(
            verdict.of_windows, partial(other_length, model, run, design, fit.p, equation_error)
        ),
        "shorter derivatives": lambda: compared(
            verdict.of_smoothing, partial(shorter_rates, model, run, design, fit.p, equation_error)
        ),
    }


def _halves_agree(model: CompiledModel, fit: Fit) -> bool:
    """Whether the halves of a run agree in a fit with terms: else something changed, which those terms imitate."""
    found = attempted(lambda: verdict.of_halves(model, fit, verdict.halves_of(fit)))
    return found is not None and not any(one.alarm for one in found)


def by_sensors(fit: Fit) -> Fit | None:
    """The same with the weights of the sensors alone, of a model with unmeasured coordinates.

    The error of an equation that is left when these are eliminated is no force: its cause may be an error of a signal.
    None: nothing was eliminated, or the weights are those of the sensors.
    """
    model = fit.rows.compiled.bare
    hidden = {jet.of for jet in model.hidden} - {jet.of for jet in model.opaque}
    if not hidden or not any(one.variance for one in fit.errors):
        return None
    return batch(fit.rows, fit.p, equation_error=False)


def shorter_rates(
    model: Compiled, run: Mapping[str, npt.ArrayLike], design: WeakDesign, p: Float, equation_error: bool = True
) -> Fit | None:
    """The same with derivatives over fewer samples; None where there are none, or too few samples for the degree."""
    taps = 2 * round(_SHORTER * design.rate_taps / 2) + 1
    if not any(jet.order for jet in model.channels.needed) or taps <= design.rate_degree + 2:
        return None
    rows = WeakRows.of(model, run, replace(design, rate_taps=taps))
    return gated(rows, p, equation_error, passes=PASSES_COMPARED, settled=COMPARED)


def other_length(
    model: Compiled, run: Mapping[str, npt.ArrayLike], design: WeakDesign, p: Float, equation_error: bool = True
) -> Fit | None:
    """The same with windows of another length, twice if the run has enough of them, else half; None: neither fits."""
    for factor in (2.0, 0.5):
        try:
            other = replace(design, window_s=factor * design.window_s)
            rows = WeakRows.of(model, run, other)
        except PvidError:
            continue
        if rows.windows >= 8:
            return gated(rows, p, equation_error, passes=PASSES_COMPARED, settled=COMPARED)
    return None
