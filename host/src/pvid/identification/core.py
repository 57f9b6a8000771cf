"""Identification of a described mechanism by the C core in float32 or fixed point, compiled for this computer.

The float64 analysis of the recording comes first, for the verdict; then the identifier's design is chosen, and the
equations' own errors found. The identifier starts at the estimate of that design if it is plausible, else at the
guesses, runs over the samples as on a board, and publishes standard errors up to 30 %, a board's 5 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.wording import listed, with_unit
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.shared import CLASH
from pvid.configuration.weak import config_to_identify, samples_of
from pvid.configuration.weak_q31 import weak_q31_to_identify
from pvid.core.native import Publisher
from pvid.identification.answer import Analysis, Answer, Value
from pvid.identification.values import unless_held, values_of
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.failures import FAILURES
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.verdict import Reason, Verdict
from pvid.rig.run import Recording
from pvid.settings.cores import CORES
from pvid.settings.enums import Core, Standing
from pvid.settings.enums import Reason as Outcome
from pvid.settings.record import Record, standing_text

if TYPE_CHECKING:
    from pvid.identification.validation import Validation

# Reasons of ticks that end no window.
_WITHIN = (Outcome.WARMING_UP, Outcome.ACCUMULATED, Outcome.REJECTED_NOT_FINITE, Outcome.REJECTED_SATURATED)


@dataclass(frozen=True)
class Publications:
    """Every estimate that was published during a run: t [n] in s, p and their standard errors [n, n_p]."""

    t: Float
    p: Float
    se: Float


@dataclass(frozen=True, eq=False)
class CoreAnswer(Answer):
    """An identification by the C core, beside the analysis in float64.

    Attributes
    ----------
    model, recording, advice : of the analysis
    analysis : of the same recording
    core : arithmetic
    functions, decimation, hop_s : of the identifier's design
    averages_signs : whether signs are averaged over a step
    values : by name: outputs of the model, then p; of the last published estimate
    published : whether there is one
    reason : of the last window
    standing : of the estimate behind it, in words: pvid/standing.h
    misfit : of the published estimate; None: not judged
    windows : how many the identifier has judged
    hash : running hash of its state after the last tick
    publications : every estimate that was published; their standard errors contain what `values` contains
    by_analysis : nothing is published, because a parameter may be 0; the values are those of the analysis
    """

    model: CompiledModel
    recording: Recording
    advice: tuple[str, ...]
    analysis: Analysis
    core: Core
    functions: int
    decimation: int
    hop_s: float
    averages_signs: bool
    values: Mapping[str, Value]
    published: bool
    reason: Outcome
    standing: str
    misfit: float | None
    windows: int
    hash: int
    publications: Publications
    by_analysis: bool = False

    @property
    def identified(self) -> bool:
        """Whether the core has published, or need not, and the recording shows a parameter."""
        return (self.published or self.by_analysis) and self.analysis.identified

    def history(self) -> list[tuple[float, Mapping[str, Value]]]:
        """Time [s] and values of every publication; correlations are those of the analysis."""
        own, model = self.publications, self.model
        sd = np.sqrt(np.diag(self.analysis.found.covariance))
        correlation = self.analysis.found.covariance / np.outer(sd, sd)
        none, judged, verdict = np.zeros((1, len(sd))), self.analysis.found.judged, self.verdict
        return [
            (float(t), values_of(model, p, correlation * np.outer(se, se), none, judged, verdict, of_known=False))
            for t, p, se in zip(own.t, own.p, own.se, strict=True)
        ]

    @property
    def unseen(self) -> Validation | None:
        """That of the analysis."""
        return self.analysis.unseen

    @property
    def verdict(self) -> Verdict:
        """The doubts of the core's own answer, then those of the analysis."""
        return Verdict((*self._doubts(), *self.analysis.found.verdict.reasons))

    def _doubts(self) -> Iterator[Reason]:
        if not self.identified:
            if self.analysis.identified:
                yield Reason("not_identified", f"The C core has published no estimate: {self.reason.text}.")
            return
        if self.by_analysis:
            yield Reason(
                "held",
                f"The C core publishes nothing ({self.reason.text}), as a parameter may be 0: the values are those of "
                "the float64 analysis.",
            )
            return
        if apart := [name for name in self.model.p_names if self._clashes(name)]:
            first = [values[apart[0]] for values in (self.values, self.analysis.values)]
            one, other = (with_unit(found.value or 0.0, found.unit, 4) for found in first)
            of_signs = " The core takes the mean of a friction's sign over a step, the analysis locates its reversals."
            yield Reason(
                "core",
                f"The C core and the float64 analysis disagree on {listed(apart)} ({apart[0]}: "
                f"{one} and {other}); the analysis is nearer." + (of_signs if self.averages_signs else ""),
                of=tuple(apart),
            )
        if self.reason not in (Outcome.UPDATED, Outcome.MISFIT):
            yield Reason(
                "held", f"The C core holds an earlier estimate, its last windows published nothing: {self.reason.text}."
            )
        if self.reason == Outcome.MISFIT and self.misfit is not None:
            yield Reason(
                "misfit",
                f"The residuals in the C core are {self.misfit:.3g} times what the sensors explain; standard errors "
                "are from their scatter.",
                alarm=False,
            )

    def _clashes(self, name: str) -> bool:
        one, other = self.values[name], self.analysis.values[name]
        if one.value is None or one.se_noise is None or other.value is None or other.se_noise is None:
            return False
        # What gains and constants are off by is the same in both. No core resolves more than float32 does.
        resolved = float(np.spacing(np.float32(abs(other.value))))
        return abs(one.value - other.value) > CLASH * math.hypot(one.se_noise, other.se_noise, resolved)

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        return f"weak form, C in {CORES[self.core].words}"

    @property
    def method(self) -> list[str]:
        """Its last window, and the hash."""
        misfit = "not judged" if self.misfit is None else f"{self.misfit:.2g}"
        return [
            f"last window: {self.reason.text}; {self.standing}; chi2 {misfit}; "
            f"{self.windows} windows of {2 * self.hop_s:.3g} s; hash {self.hash:08x}"
        ]

    @property
    def status(self) -> str:
        """The last word of the core, where it publishes nothing."""
        return self.verdict.status if self.published else self.reason.text

    @property
    def why_nothing(self) -> str:
        """The reason of the last window."""
        return "" if self.published else self.reason.text

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        return (
            self.analysis.as_json()
            | super().as_json()
            | {
                "chi2": self.misfit,
                "reason": self.reason.text,
                "standing": self.standing,
                "window_s": 2 * self.hop_s,
                "windows": self.windows,
                "functions": self.functions,
                "decimation": self.decimation,
                "hash": f"{self.hash:08x}",
                "core": self.core,
            }
        )


@dataclass(frozen=True, eq=False)
class _Run:
    """The C core after a recording, in the units of the model.

    p, covariance : of the published estimate
    published : p and standard errors published after every tick [ticks, n_p]
    """

    core: Core
    functions: int
    decimation: int
    hop_s: float
    signs: int
    identifier: Publisher
    record: Record
    p: Float
    covariance: Float
    published: tuple[Float, Float]


def identify_in_c(answer: Analysis, core: Core = "f32") -> CoreAnswer:
    """The same recording by the C core.

    Raises PvidError when there is no C compiler, or the identifier does not have what the model needs.
    """
    try:
        run = _RUNS[core](answer)
    except FAILURES as error:  # a search that runs away among them
        raise PvidError(f"--core {core}: {error}") from error
    return _answer(answer, run)


def _in_float(answer: Analysis) -> _Run:
    config = config_to_identify(answer.model, answer.recording, answer.ranking)
    design = config.design
    identifier = weak_native(answer.model, design).identifier_of(config)
    record = identifier.run_samples(samples_of(config, answer.recording.signals), sums=False)
    last, n_p = identifier.estimate, len(answer.found.p)
    return _Run(
        "f32",
        design.functions,
        design.decimation,
        config.hop_s,
        design.model.signs,
        identifier,
        record,
        np.asarray(last["p"][:n_p], np.float64),
        np.asarray(last["covariance"], np.float64)[:n_p, :n_p],
        (record.published.astype(np.float64), record.published_se.astype(np.float64)),
    )


def _in_fixed_point(answer: Analysis) -> _Run:
    weak = weak_q31_to_identify(answer.model, answer.recording, answer.ranking)
    design = weak.config.design
    identifier = weak_native_q31(weak.made, weak.parameters, weak.config).identifier()
    record = identifier.run_samples(weak.counts_of(answer.recording.signals), sums=False)
    last, n_p = identifier.estimate, len(answer.found.p)
    se = weak.values(np.maximum(last["se"][:n_p], 1))  # an error below the format's step counts as a step
    correlation = np.asarray(last["correlation"], np.float64)[:n_p, :n_p] * 2.0**-30
    return _Run(
        "q31",
        design.functions,
        design.decimation,
        weak.hop_s,
        design.model.signs,
        identifier,
        record,
        weak.values(last["p"][:n_p]),
        correlation * np.outer(se, se),
        (weak.values(record.published), weak.values(record.published_se)),
    )


_RUNS = dict(zip(CORES, (_in_float, _in_fixed_point), strict=True))


def _answer(answer: Analysis, run: _Run) -> CoreAnswer:
    identifier, record = run.identifier, run.record
    published = identifier.is_published
    ends = record.reason[~np.isin(record.reason, _WITHIN)]
    model, found = answer.model, answer.found
    # The larger of two standard errors: halves and other windows of the run are seen by the analysis alone.
    own = np.sqrt(np.diag(run.covariance))  # 0 of what constraints fix
    wider = np.maximum(np.divide(found.noise, own, out=np.ones(len(own)), where=own > 0), 1.0)
    covariance = run.covariance * np.outer(wider, wider)
    # A core searches logarithms: of what may be 0 it stays uncertain, and publishes nothing.
    by_analysis = not published and any(one.status == "near_zero" for one in found.judged)
    outcome = Outcome(int(ends[-1])) if len(ends) else Outcome.WARMING_UP
    judged = unless_held(found.judged, None if published else outcome.text)

    # Where the analysis publishes another estimate of the same equations, its distance belongs to the model's part.
    apart = np.abs(found.p - run.p)
    noise = np.hypot(found.noise, np.sqrt(np.diag(covariance)))
    shifts = np.vstack([found.shifts, np.where(apart > CLASH * noise, apart, 0.0)])

    def values(verdict: Verdict) -> Mapping[str, Value]:
        if by_analysis:
            return answer.values
        return values_of(model, run.p, covariance, found.gains, judged, verdict, shifts)

    misfit = identifier.misfit
    core = CoreAnswer(
        model=model,
        recording=answer.recording,
        advice=answer.advice,
        analysis=answer,
        core=run.core,
        functions=run.functions,
        decimation=run.decimation,
        hop_s=run.hop_s,
        averages_signs=run.signs > 0,
        values=values(found.verdict),
        published=published,
        reason=outcome,
        standing=standing_text(int(record.standing[-1])) if len(record.standing) else Standing.NONE.text,
        misfit=None if not published or np.isnan(misfit) else misfit,
        windows=int(len(ends)),
        hash=identifier.running_hash,
        publications=_published(answer, run, found.gains, wider),
        by_analysis=by_analysis,
    )
    return replace(core, values=values(core.verdict))


def _published(answer: Analysis, run: _Run, gains: Float, wider: Float) -> Publications:
    """All publications of a run: their own errors, times what the analysis found, and those of gains and constants."""
    ticks = np.flatnonzero(np.isin(run.record.reason, (Outcome.UPDATED, Outcome.MISFIT)))
    n_p = len(wider)
    p, own = run.published
    se = np.hypot(own[ticks, :n_p] * wider, np.sqrt(np.sum(gains**2, axis=0)))
    return Publications(answer.recording.t[ticks], p[ticks, :n_p], se)
