"""Values of an answer, with the parts of their standard errors: parameters, and outputs that follow from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.identification.answer import Factors, Value
from pvid.model.compiled import CompiledModel, Output
from pvid.model.evaluation import with_slopes
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.verdict import Judged, Verdict
from pvid.oracle.weak.words import WIDE, Word, worst

Float = npt.NDArray[np.float64]


def values_of_found(model: CompiledModel, found: Identified) -> dict[str, Value]:
    """Outputs of the model, then p, by name."""
    # The correlations of the rows, with the published standard errors but for gains and constants.
    widened = found.noise / np.sqrt(np.diag(found.covariance))
    covariance = found.covariance * np.outer(widened, widened)
    return values_of(model, found.p, covariance, found.gains, found.judged, found.verdict, found.shifts)


def refined_gains_of(model: CompiledModel, found: Identified) -> Float:
    """`gains` of a refined estimate, whose equations neglect nothing where the refinement has its own."""
    return found.gains[:-1] if model.refinement.equations else found.gains


def refined_shifts_of(model: CompiledModel, found: Identified) -> Float:
    """`shifts` of a refined estimate: where the refinement has its own equations, what the linear rows lack counts only
    where it is more than they neglect."""
    far = np.abs(found.shifts) > found.by_neglect
    return np.where(far, found.shifts, 0.0) if model.refinement.equations else found.shifts


def values_of(
    model: CompiledModel,
    p: Float,
    covariance: Float,
    gains: Float,
    judged: Sequence[Judged],
    verdict: Verdict,
    shifts: Float | None = None,
    *,
    of_known: bool = True,
) -> dict[str, Value]:
    """Outputs of the model, then p, by name.

    Parameters
    ----------
    covariance : of p by noise [n_p, n_p]
    gains, shifts : as Identified has them; no shifts: no terms were tried
    judged : of each parameter; an output is identified where all parameters that it depends on are, or
        where its error is small with the errors of those that are not
    verdict : whose word a parameter has; an output has the worst of those that it depends on
    of_known : the first of the gains are those of constants, in which an output may stand by itself
    """
    terms = np.zeros((0, len(p))) if shifts is None else shifts
    root = _root(covariance)

    def shown(unit: str, value: float, slope: Float, of: Judged, word: Word, direct: Float | float = 0.0) -> Value:
        if of.status == "not_identified":
            return Value(unit, None, None, None, of.status, of.reason, word="not_identified")
        se_noise, se_scale = float(np.sqrt(slope @ covariance @ slope)), float(np.linalg.norm(gains @ slope + direct))
        se_model = float(np.max(np.abs(terms @ slope), initial=0.0))
        se = math.hypot(se_noise, se_scale, se_model)
        factors = Factors(root @ slope, gains @ slope + direct, terms @ slope)
        return Value(unit, value, se, se_noise, of.status, of.reason, of.below, se_model, se_scale, word, factors)

    values = {}
    for one in model.outputs:
        value, slope = output_at(model, p, one)
        own = [k for k, symbol in enumerate(model.p) if one.value.has(symbol)]
        lost = [k for k in own if judged[k].status == "not_identified"]
        word = worst(verdict.of(model.p_names[k]) for k in own if k not in lost)
        missing = judged[min(lost, key=lambda k: judged[k].has_error)] if lost else Judged()
        if lost and missing.has_error:
            whole = covariance + gains.T @ gains
            most = max(float(np.sqrt(slope @ whole @ slope)), _farthest(model, p, one, lost, whole) / 2)
            hardly = most <= WIDE * abs(value)
            missing, word = (Judged(), worst([word, "usable"])) if hardly else (missing, word)
        if missing.status == "not_identified":
            slope = np.where([of.status == "not_identified" for of in judged], 0.0, slope)
        elif not np.isfinite([value, *slope]).all():
            missing = Judged("not_identified", "its formula has no real value at these parameters")
        direct = np.zeros(len(gains))
        if of_known:
            by_known = _of_constants(model, p, one, value)
            direct[: len(by_known)] = by_known
        found = shown(one.unit, value, slope, missing, word, direct)
        if found.value is not None and not (found.se or 0.0) <= WIDE * abs(found.value):
            found = replace(found, word=worst([word, "usable"]))
        values[one.name] = found
    for k, unknown in enumerate(model.unknowns):
        values[unknown.name] = shown(unknown.unit, float(p[k]), np.eye(len(p))[k], judged[k], verdict.of(unknown.name))
    return values


def _farthest(model: CompiledModel, p: Float, output: Output, lost: Sequence[int], covariance: Float) -> float:
    """How far an output moves from p where a lost parameter does, by two standard errors within its bounds, and the
    others with it, by differences or by factors, whichever it is that the run does not show; inf where it has no value
    there. Its slope alone is 0 at a minimum."""
    value, moves = output_at(model, p, output)[0], [0.0]
    positive = np.array([one.positive for one in model.unknowns])
    for k in lost:
        se, (low, high) = math.sqrt(covariance[k, k]), model.unknowns[k].bounds
        low = max(low, 0.0) if positive[k] else low
        for end in np.clip([p[k] - 2 * se, p[k] + 2 * se], low, high) if se else ():
            step = (end - p[k]) * covariance[k] / se**2
            with np.errstate(all="ignore"):
                factors = np.where(positive, p * np.exp(step / p), p + step)
            away = np.abs([output_at(model, moved, output)[0] - value for moved in (p + step, factors)])
            moves.append(float(np.min(np.where(np.isfinite(away), away, np.inf))))
    return max(moves)


def _root(covariance: Float) -> Float:
    """A matrix whose square is a covariance [n_p, n_p]; 0 where it has numbers that are none."""
    if not np.isfinite(covariance).all():
        return np.zeros_like(covariance)
    squares, directions = np.linalg.eigh(covariance)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0))[:, np.newaxis] * directions.T)


def unless_held(judged: Sequence[Judged], reason: str | None) -> Sequence[Judged]:
    """Of each parameter; with a reason (a clause) why an identifier publishes nothing, none is identified."""
    return judged if reason is None else [Judged("not_identified", reason)] * len(judged)


def outputs_at(model: CompiledModel, p: Float) -> dict[str, float]:
    """Outputs of the model at p [n_p], by name."""
    return {one.name: output_at(model, p, one)[0] for one in model.outputs}


def _of_constants(model: CompiledModel, p: Float, output: Output, value: float) -> list[float]:
    """What an output at p is off by for one standard deviation of each constant that has any, beside what p is."""
    off = []
    for known in model.knowns:
        if known.sd > 0:
            moved = tuple(replace(one, value=one.value + one.sd) if one is known else one for one in model.knowns)
            stands = output.value.has(known.symbol)
            off.append(output_at(replace(model, knowns=moved), p, output)[0] - value if stands else 0.0)
    return off


def output_at(model: CompiledModel, p: Float, output: Output) -> tuple[float, Float]:
    """Value at p and its gradient [n_p]; NaN where it does not exist at p."""
    value = model.with_knowns(output.value)
    with np.errstate(all="ignore"):
        (at,), (slopes,) = with_slopes((value,), model.p)(*p.astype(complex))
    if abs(complex(at).imag) > 0:
        return float("nan"), np.full(len(p), np.nan)
    return complex(at).real, np.array(slopes, complex).real
