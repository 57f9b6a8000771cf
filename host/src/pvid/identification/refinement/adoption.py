"""The answer after a refinement: whether it is adopted, why, and what it makes of the weak form's parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.codegen.refine import SKEW
from pvid.identification.answer import Analysis
from pvid.identification.refinement.fit import GOOD, NOISE
from pvid.identification.refinement.problem import RefinedMechanism
from pvid.identification.refinement.scales import scales_of
from pvid.identification.refinement.search import TOO_LONG, refine
from pvid.identification.values import refined_gains_of, refined_shifts_of, values_of
from pvid.oracle.weak import verdict
from pvid.oracle.weak.verdict import Judged, Name, Reason
from pvid.oracle.weak.words import WIDE

Float = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

BEARABLE = 30.0  # slow chi^2 up to which a refined answer is published, with a warning, where there is no other
AGREE = 3.0  # standard errors by which two halves of a recording may differ whose residuals are more than noise
APART = 4.0  # the same where the residuals are noise
RIVAL = 3.0  # standard errors by which a fit may differ that explains the recording as well
LARGEST_SKEW_S = 5e-3  # beyond it a skew may stand for another error
_HALF_OF_RANGE = 0.5  # of the standard deviation of a guess: a larger standard error determines no offset
_SHOWN = 3  # times of jumps
_APART = 3.0  # standard errors of the difference: two answers that differ by more do
# Reasons about the recording itself, which hold for any estimate from it.
_OF_RECORDING: tuple[Name, ...] = (
    "clipped",
    "resting",
    "counts",
    "rate",
    "feedback",
    "sensor",
    "scale",
    "guesses",
    "core",
)


def refined_answer(answer: Analysis) -> tuple[Analysis, RefinedMechanism | None, str]:
    """The answer after a refinement that starts from it, the refinement, and what became of it in a clause; the same
    answer where it is not adopted."""
    try:
        with np.errstate(all="ignore"):  # what diverges is judged
            refined = refine(answer)
    except PvidError as error:
        return answer, None, f"not refined: {error}"
    reason = _not_adopted(answer, refined)
    if reason is not None:
        kept = "the weak form's answer stands" if answer.identified else "nothing is identified"
        return answer, refined, f"{reason}: {kept}{_apart(answer, refined) if answer.identified else ''}"
    found, recording = refined.found, answer.recording
    text = f"refined over {len(found.cut.first)} blocks; chi2 {found.chi2:.2g}, of slow residuals {found.slow_chi2:.2g}"
    for place in refined.problem.kernel.widths:
        if found.covariance[place, place] > 0:
            one = refined.problem.kernel.made.parameters[place]
            text += f"; sgn({one.sign}) changes over {found.r[place]:.2g} {one.unit}"
    noted = replace(recording, notes=(*recording.notes, *_of_breaks(answer, refined)))
    advice = (*answer.advice, *_of_skew(answer, refined))
    return replace(_adopted(answer, refined), recording=noted, advice=advice), refined, text


def _estimate(refined: RefinedMechanism) -> tuple[Float, Float]:
    """p [n_p] and its covariance [n_p, n_p]."""
    return refined.problem.values(refined.found, refined.problem.kernel.made.places_of_p)


def _determined(answer: Analysis, refined: RefinedMechanism) -> Bool:
    """Which parameters have a standard error that is small beside their value, or beside the range of a guess, and are
    within their bounds [n_p]."""
    p, covariance = _estimate(refined)
    se = np.sqrt(np.diag(covariance))
    limit = [WIDE * abs(x) if one.positive else _HALF_OF_RANGE * one.sd for x, one in _with(p, answer)]
    inside = [one.bounds[0] <= x <= one.bounds[1] for x, one in _with(p, answer)]
    return np.asarray((se > 0) & (se <= limit) & inside)


def _with(p: Float, answer: Analysis) -> Iterator[tuple[float, Any]]:
    return zip(map(float, p), answer.model.unknowns, strict=True)


def _lacks(answer: Analysis) -> Bool:
    """Which parameters the weak form does not determine [n_p]."""
    return np.array([one.status == "not_identified" for one in answer.found.judged])


def _not_adopted(answer: Analysis, refined: RefinedMechanism) -> str | None:
    """Why a refinement is not the answer, in a clause; None: it is."""
    found, weak = refined.found, answer.found
    if not found.converged:
        return TOO_LONG if refined.problem.budget.is_spent else "the refinement did not converge"
    lacks, known = _lacks(answer), _determined(answer, refined)
    if not answer.identified and not known.all():
        worst = [name for name, one in zip(answer.model.p_names, known, strict=True) if not one]
        return f"the refinement does not determine {listed(worst)} either"
    apart = refined.rivals_differ()
    if apart > RIVAL:
        return f"other parameters explain the recording about as well, and differ by {apart:.2g} standard errors"
    asked, length = 2 * weak.design.window_s, found.cut.samples / answer.recording.sample_rate
    alike = not lacks.any() and not answer.model.refinement.equations
    if alike and length < asked / 2 and _spread(refined, weak.se) > 1:
        return f"blocks above {length:.2g} s do not fit, and shorter ones have larger standard errors"
    noise = found.slow_chi2 <= GOOD
    residuals = f"slow residuals have {found.slow_chi2:.2g} times the variance of the noise"
    if not (lacks & known).any():
        return None if noise or _better(answer, refined) else residuals
    if not found.slow_chi2 <= BEARABLE:
        return residuals
    differ = refined.halves_differ()  # nothing else confirms what the weak form does not determine
    if differ <= (APART if noise else AGREE) or (noise and np.isinf(differ)):
        return None
    before = "" if noise else f"{residuals}, and "
    return f"{before}the halves of the recording differ by {differ:.2g} standard errors"


def _spread(refined: RefinedMechanism, se: Float) -> float:
    """Geometric mean of the refined standard errors over those of the weak form, of parameters that both have."""
    ratio = np.sqrt(np.diag(_estimate(refined)[1])) / se
    there = np.isfinite(ratio) & (ratio > 0)
    return float(np.exp(np.mean(np.log(ratio[there])))) if there.any() else np.inf


def _better(answer: Analysis, refined: RefinedMechanism) -> bool:
    """Whether the refined answer agrees with the weak one, from the same equations, and its standard errors are
    smaller: what these lack moves both."""
    if answer.model.refinement.equations or _lacks(answer).any():
        return False
    value, covariance = _estimate(refined)
    weak, error = answer.found, np.sqrt(np.diag(covariance))
    return bool((np.abs(value - weak.p) <= _APART * np.hypot(error, weak.se)).all() and (error <= weak.se).all())


def _apart(answer: Analysis, refined: RefinedMechanism) -> str:
    """How far the two answers are apart, where that is more than both standard errors explain."""
    p, covariance = _estimate(refined)
    both = np.hypot(np.sqrt(np.diag(covariance)), answer.found.se)
    far = [
        f"{one.name} by {100 * (x / before - 1):+.3g} %"
        for (x, one), before, error, lacks in zip(_with(p, answer), answer.found.p, both, _lacks(answer), strict=True)
        if one.positive and not lacks and abs(x - before) > _APART * error
    ]
    return f"; the two differ in {', '.join(far)}" if far else ""


def _adopted(answer: Analysis, refined: RefinedMechanism) -> Analysis:
    """The answer with the refined parameters; those that the weak form did not determine are identified."""
    weak, model = answer.found, answer.model
    p, covariance = _estimate(refined)
    lacks, fresh = _lacks(answer), _lacks(answer) & _determined(answer, refined)
    judged = verdict.judged_again(model, weak.judged, p, np.sqrt(np.diag(covariance)))
    judged = tuple(Judged() if new else one for new, one in zip(fresh, judged, strict=True))
    gains, shifts = refined_gains_of(model, weak), refined_shifts_of(model, weak)
    if lacks.any():  # what an estimate that is none is off by means nothing
        shifts = np.where(lacks, 0.0, shifts)
        neglected = np.divide(weak.by_neglect, weak.p, out=np.zeros_like(p), where=weak.p != 0) * p
        gains = np.vstack([scales_of(refined), *([] if model.refinement.equations else [neglected])])
    reasons = [*_kept(answer, fresh), *_doubts(answer, refined)]
    reasons += verdict.of_bounds(model, judged, min(weak.r2.values()))
    found = replace(weak, judged=judged, verdict=verdict.Verdict(verdict.sorted_by_gravity(reasons)))
    return replace(answer, found=found, values=values_of(model, p, covariance, gains, judged, found.verdict, shifts))


def _kept(answer: Analysis, fresh: Bool) -> Iterator[Reason]:
    """Doubts that a refined answer has too: not those about parameters that it determines and the weak form did not."""
    names, lacks = answer.model.p_names, _lacks(answer)
    new = {name for name, one in zip(names, fresh, strict=True) if one}
    for one in answer.found.verdict.reasons:
        if one.name == "near_zero":
            continue
        if not new or one.name in _OF_RECORDING:
            yield one
        elif one.name in ("undetermined", "not_identified"):
            left = [name for name, lacking in zip(names, lacks, strict=True) if lacking and name not in new]
            if left:
                yield Reason("undetermined", f"The recording does not determine {listed(left)}.", of=tuple(left))
        elif one.name != "not_settled" and set(one.of or names) - new and answer.identified:
            yield one


def _doubts(answer: Analysis, refined: RefinedMechanism) -> Iterator[Reason]:
    """On what was found beside the parameters, on residuals above noise, and on a weak answer that they contradict."""
    found = refined.found
    if found.slow_chi2 > GOOD and _lacks(answer).any():
        yield Reason("refined", f"Slow residuals have {found.slow_chi2:.2g} times the variance of the noise.")
    elif _lacks(answer).any() and np.isinf(refined.halves_differ()):
        text = "A half of the recording alone does not determine the parameters: nothing confirms the standard errors."
        yield Reason("refined", text)
    if found.slow_chi2 > NOISE and (apart := _apart(answer, refined)):
        text = f"The refined answer is far from that of the weak form, and its residuals are more than noise{apart}."
        yield Reason("refined", text)
    skew, se = refined.extras.get(SKEW, (0.0, 0.0))
    if abs(skew) > max(LARGEST_SKEW_S, 3 * se):
        driven = listed(_differentiated(answer))
        text = (
            f"The fit needs a delay of {1000 * skew:.3g} ms between the samples of {driven} and those of the other "
            "sensors: if they are sampled together, the equations lack something else, such as a dry friction."
        )
        yield Reason("skew", text)


def _differentiated(answer: Analysis) -> list[str]:
    """Driven sensors."""
    return [one.name for one in answer.model.signals if one.driven and one.kind == "sensor"]


def _of_skew(answer: Analysis, refined: RefinedMechanism) -> Iterator[str]:
    """A sentence with what to type, where the one differentiated sensor is read half a sample or more too late or too
    early, and by no more than sensors are."""
    skew, se = refined.extras.get(SKEW, (0.0, 0.0))
    driven = _differentiated(answer)
    if len(driven) == 1 and max(3 * se, 0.5 / answer.recording.sample_rate) < abs(skew) <= LARGEST_SKEW_S:
        late = "later" if skew < 0 else "earlier"
        delay = answer.model.signal(driven[0]).delay - skew
        yield (
            f"{driven[0]} is read {1000 * abs(skew):.3g} ms {late} than the other sensors: --set "
            f"sensor.{driven[0]}.delay={delay:.3g} corrects the weak form too"
        )


def _of_breaks(answer: Analysis, refined: RefinedMechanism) -> Iterator[str]:
    """A sentence on jumps of a signal whose derivatives drive the mechanism."""
    if refined.breaks:
        began = float(answer.recording.t[0])
        places = listed([f"{began + t:.4g} s" for t in refined.breaks[:_SHOWN]])
        more = f" and {len(refined.breaks) - _SHOWN} other times" if len(refined.breaks) > _SHOWN else ""
        yield (
            f"{listed(_differentiated(answer))} jumps at {places}{more}: lost samples that do not show in t, a "
            "repeated buffer, or a changed offset; the refinement starts a new block after each jump"
        )
