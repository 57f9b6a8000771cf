"""`pvid identify --refine` of the pendulum: the refined answer in place of the weak one where it is worth more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolved
from pvid.run.engine_identify import NO_CORE, held_if_wide
from pvid.run.identify import Identification, largest_angle, parts_of
from pvid.run.refined import GOOD, NOISE
from pvid.run.refined_pendulum import TOO_LONG, RefinedPendulum, refine_pendulum
from pvid.settings.enums import Reason
from pvid.setup.f32 import nominal_start

Float = npt.NDArray[np.float64]

_SCALES = (1.0, 0.45, 2.2)  # of the guessed lengths: starts
BEARABLE = 30.0  # slow chi^2 up to which a refined answer is published, with a warning, where there is no other
AGREE = 3.0  # standard errors by which two halves of a run may differ whose residuals are more than noise
LARGEST_SKEW_S = 5e-3  # beyond it a skew may stand for another error
_SHOWN = 3  # times of jumps
LARGEST_SE = (0.05, 0.05, 0.1)  # relative, of w, d1, d2: beyond, the run does not determine them


@dataclass(frozen=True, eq=False)
class RefinementVerdict:
    """What became of the refinement of a run.

    Attributes
    ----------
    adopted : the answer is the refined one
    text : why, in a clause
    outcome : the fit; None where there is none
    """

    adopted: bool
    text: str
    outcome: RefinedPendulum | None = None

    def as_json(self) -> dict[str, Any]:
        """For `identify --json`; other parameters by name with value and standard error."""
        found = None if self.outcome is None else self.outcome.found
        extras = {} if self.outcome is None else self.outcome.extras
        return {
            "adopted": self.adopted,
            "text": self.text,
            "chi2": None if found is None else found.chi2,
            "slow_chi2": None if found is None else found.slow_chi2,
            "blocks": None if found is None else len(found.cut.first),
            "parameters": {name: {"value": value, "se": se} for name, (value, se) in extras.items() if 0 < se < np.inf},
        }


def refined_identification(run: Run, rig: RigFile, weak: Identification) -> Identification:
    """The answer after a refinement of the whole run, which starts from the weak one."""
    rig = resolved(rig, run)
    rest = float(np.nanmedian(run.phi))
    model = weak.model
    names = (*model.mapped_names, model.offset_name)
    starts = [{model.offset_name: rest, **{name: weak.value[name] for name in names if name in weak.value}}]
    for guess in _starts_about(rig):
        starts.append(dict(zip(names, map(float, (*nominal_start(guess), rest)), strict=True)))
    try:
        outcome = refine_pendulum(run, rig, starts, sure=weak.identified)
    except PvidError as error:
        return replace(weak, refinement=RefinementVerdict(False, f"not refined: {error}"))
    adopted, text = _judged(outcome, weak)
    verdict = RefinementVerdict(adopted, text, outcome)
    return _answer(run, rig, weak, verdict) if adopted else replace(weak, refinement=verdict)


def _starts_about(rig: RigFile) -> Iterator[RigFile]:
    """Rig files with guesses about that of the rig file, itself first."""
    guess = rig.nominal
    for l2 in _SCALES:
        for rho2 in _SCALES:
            with suppress(PvidError):  # a length beyond those of a rig file
                yield replace(rig, nominal=replace(guess, l2=guess.l2 * l2, rho2=guess.rho2 * rho2))


def _judged(outcome: RefinedPendulum, weak: Identification) -> tuple[bool, str]:
    found = outcome.found
    se = np.sqrt(np.diag(found.covariance)[: weak.model.n_mapped])
    stands = held_if_wide(weak).identified
    kept = "the weak form's answer stands" if stands else "nothing is identified"
    if not found.converged:
        spent = outcome.problem.budget.is_spent
        return False, f"{TOO_LONG}; {kept}" if spent else f"the refinement did not converge: {kept}"
    if not (se <= LARGEST_SE).all():
        return False, f"the refined parameters have a standard error of {100 * float(se.max()):.2g} %: {kept}"
    if (rivalry := outcome.rivalry) is not None:
        return False, f"{rivalry}: {kept}"
    residuals = f"slow residuals have {found.slow_chi2:.2g} times the variance of the noise"
    if stands and not found.slow_chi2 <= GOOD:
        return False, f"{residuals}: {kept}{_apart(outcome, weak)}"
    if not found.slow_chi2 <= BEARABLE:
        return False, f"{residuals}: {kept}"
    if not found.slow_chi2 <= GOOD:
        differ = float(outcome.halves_differ().max())
        if not differ <= AGREE:
            return False, f"{residuals}, and the halves of the run differ by {differ:.2g} standard errors: {kept}"
    return (
        True,
        f"refined over {len(found.cut.first)} blocks; chi2 {found.chi2:.2g}, of slow residuals {found.slow_chi2:.2g}",
    )


def _apart(outcome: RefinedPendulum, weak: Identification) -> str:
    """How far the two answers are apart, where that is more than both standard errors explain."""
    model, sd = weak.model, np.sqrt(np.diag(outcome.found.covariance))
    far = []
    for k, name in enumerate(model.mapped_names):
        value = outcome.found.r[k]
        both = float(np.hypot(sd[k] * value, weak.se[name]))
        if abs(value - weak.value[name]) > 3 * both:
            far.append(f"{name} by {100 * (value / weak.value[name] - 1):+.3g} %")
    return f"; the two differ in {', '.join(far)}" if far else ""


def _doubts(outcome: RefinedPendulum, weak: Identification) -> Iterator[str]:
    """Sentences on what was found beside the parameters, and on a weak answer that residuals above noise contradict."""
    if weak.identified and outcome.found.slow_chi2 > NOISE and (apart := _apart(outcome, weak)):
        yield f"The refined answer is far from that of the weak form, and its residuals are more than noise{apart}."
    skew, se = outcome.extras["tau"]
    if abs(skew) > max(LARGEST_SKEW_S, 3 * se):
        yield (
            f"The fit needs a delay of {1000 * skew:.3g} ms between the samples of y and phi: if they are sampled "
            "together, the equations lack something else, such as a dry friction."
        )


def _remarks(outcome: RefinedPendulum) -> Iterator[str]:
    """Sentences on what the refinement left out."""
    if outcome.breaks:
        places = listed([f"{t:.4g} s" for t in outcome.breaks[:_SHOWN]])
        more = f" and {len(outcome.breaks) - _SHOWN} other times" if len(outcome.breaks) > _SHOWN else ""
        yield (
            f"y jumps at {places}{more}: lost samples that do not show in t, a repeated buffer, or a changed offset of "
            "y. The refinement starts a new block after each jump."
        )


def _answer(run: Run, rig: RigFile, weak: Identification, verdict: RefinementVerdict) -> Identification:
    """The refined parameters with their errors, those of the scales among them."""
    assert verdict.outcome is not None
    outcome, found = verdict.outcome, verdict.outcome.found
    model, mechanism = weak.model, rig.mechanism
    names = (*model.mapped_names, model.offset_name)
    places = [outcome.names.index(name) for name in names]
    p, covariance = outcome.problem.values(found, places)
    value = dict(zip(names, map(float, p), strict=True))
    noise = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    physical = mechanism.physical(p)
    if np.isfinite(physical).all():
        value.update(zip(model.physical_names, map(float, physical), strict=True))
        noise.update(zip(model.physical_names, map(float, mechanism.physical_errors(p, covariance)), strict=True))
    parts = parts_of(noise, p, rig)
    return replace(
        weak,
        value=value,
        se={name: one.whole for name, one in parts.items()},
        parts=parts,
        trusted_s=float(run.t[-1]),
        first_publication_s=weak.first_publication_s if weak.first_publication_s is not None else float(run.t[-1]),
        chi2=found.slow_chi2,
        alarm=found.slow_chi2 > GOOD,
        doubts=None if weak.doubts is None else tuple(_doubts(outcome, weak)),
        remarks=(*(one for one in weak.remarks if one.startswith(NO_CORE)), *_remarks(outcome)),
        status=Reason.UPDATED.text,
        largest_angle=largest_angle(run, value[model.offset_name]),
        refinement=verdict,
    )
