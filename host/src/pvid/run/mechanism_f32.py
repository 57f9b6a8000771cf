"""Identification of a described mechanism by the C core in float32, compiled for this computer.

The float64 oracle analyses the recording first, for the verdict; then it chooses the engine's design and finds the
equations' own errors. The engine starts at the guesses and runs over the samples as on a board.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.wording import listed, with_unit
from pvid.codegen.fourier_library import fourier_native
from pvid.core.fourier_native import FourierIdentifier
from pvid.oracle.fourier.functions import Float
from pvid.oracle.fourier.verdict import Reason, Verdict
from pvid.run.engine_design import config_to_identify, samples_of
from pvid.run.identify import Publications
from pvid.run.mechanism import MechanismAnswer, Value, gains_of, noise_of, own_keys, values_of
from pvid.settings.enums import Reason as Outcome
from pvid.settings.fourier import FourierConfig
from pvid.settings.record import Record

# The core and the analysis disagree if they differ by so many standard errors, and by this part of the value.
_CLASH = 3.0
_VISIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class CoreAnswer:
    """An identification by the C core, beside that of the oracle.

    Attributes
    ----------
    oracle : of the same recording
    config : of the engine
    values : by name: outputs of the model, then p; of the last published estimate
    published : whether there is one
    reason : of the last window
    misfit : of the published estimate; None: not judged
    windows : how many the engine has judged
    hash : running hash of its state after the last tick
    publications : every estimate that was published; their standard errors contain what `values` contains
    """

    oracle: MechanismAnswer
    config: FourierConfig
    values: Mapping[str, Value]
    published: bool
    reason: Outcome
    misfit: float | None
    windows: int
    hash: int
    publications: Publications

    @property
    def identified(self) -> bool:
        """Whether the core has published, and the recording shows every parameter."""
        return self.published and self.oracle.identified

    @property
    def verdict(self) -> Verdict:
        """The doubts of the core's own answer, then those of the analysis."""
        return Verdict((*self._doubts(), *self.oracle.found.verdict.reasons))

    def _doubts(self) -> Iterator[Reason]:
        if not self.identified:
            return
        if apart := [name for name in self.oracle.model.p_names if self._clashes(name)]:
            first = [values[apart[0]] for values in (self.values, self.oracle.values)]
            one, other = (with_unit(found.value or 0.0, found.unit, 4) for found in first)
            of_signs = " The core takes the mean of a friction's sign over a step, the analysis locates its reversals."
            yield Reason(
                "core",
                f"The C core and the float64 analysis disagree on {listed(apart)} ({apart[0]}: "
                f"{one} and {other}); the analysis is nearer." + (of_signs if self.config.design.model.signs else ""),
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
        one, other = self.values[name], self.oracle.values[name]
        if one.value is None or one.se is None or other.value is None or other.se is None:
            return False
        apart = abs(one.value - other.value)
        return apart > _CLASH * math.hypot(one.se, other.se) and apart > _VISIBLE * abs(other.value)

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        design = self.config.design
        parameters = {
            name: {"value": one.value, "se": one.se, "unit": one.unit, "se_noise": one.se_noise}
            for name, one in self.values.items()
        }
        return self.oracle.as_json() | {
            "identified": self.identified,
            "parameters": parameters,
            **own_keys(self.oracle.model, parameters),
            "status": self.verdict.status,
            "warning": self.verdict.warning,
            "reasons": {one.name: one.text for one in self.verdict.reasons},
            "chi2": self.misfit,
            "reason": self.reason.text,
            "window_s": 2 * self.config.hop_s,
            "windows": self.windows,
            "functions": design.functions,
            "decimation": design.decimation,
            "hash": f"{self.hash:08x}",
            "core": "f32",
        }


def identify_in_c(answer: MechanismAnswer) -> CoreAnswer:
    """The same recording by the C core.

    Raises
    ------
    PvidError
        When there is no C compiler, or the engine does not have what the model needs.
    """
    recording, compiled = answer.recording, answer.model
    try:
        config = config_to_identify(compiled, recording)
        native = fourier_native(compiled, config.design)
        identifier = native.identifier_of(config)
    except PvidError as error:
        raise PvidError(f"--core f32: {error}") from error
    record = identifier.run_samples(samples_of(config, recording.signals), sums=False)
    return _answer(answer, config, identifier, record)


def _answer(
    answer: MechanismAnswer, config: FourierConfig, identifier: FourierIdentifier, record: Record
) -> CoreAnswer:
    estimate = identifier.published
    model, found = answer.model, answer.found
    ends = record.reason[(record.reason != Outcome.WARMING_UP) & (record.reason != Outcome.ACCUMULATED)]
    n_p = len(found.p)
    last = identifier.estimate
    covariance = np.asarray(last["covariance"], np.float64)[:n_p, :n_p]
    # The larger of two standard errors: halves and other windows of the run are seen by the analysis alone.
    wider = np.maximum(noise_of(model, found) / np.sqrt(np.diag(covariance)), 1.0)
    covariance = covariance * np.outer(wider, wider)
    values = values_of(
        model,
        np.asarray(last["p"][:n_p], np.float64),
        covariance,
        gains_of(model, found),
        identified=estimate is not None and answer.identified,
    )
    misfit = identifier.misfit
    return CoreAnswer(
        oracle=answer,
        config=config,
        values=values,
        published=estimate is not None,
        reason=Outcome(int(ends[-1])) if len(ends) else Outcome.WARMING_UP,
        misfit=None if estimate is None or np.isnan(misfit) else misfit,
        windows=int(len(ends)),
        hash=identifier.running_hash,
        publications=_published(answer, record, gains_of(model, found), wider),
    )


def _published(answer: MechanismAnswer, record: Record, gains: Float, wider: Float) -> Publications:
    """All publications of a run: their own errors, times what the analysis found, and those of gains and constants."""
    ticks = np.flatnonzero(np.isin(record.reason, (Outcome.UPDATED, Outcome.MISFIT)))
    n_p = len(wider)
    se = np.hypot(record.published_se[ticks, :n_p] * wider, np.sqrt(np.sum(gains**2, axis=0)))
    alarm = np.full(len(ticks), answer.found.verdict.warning is not None)
    return Publications(answer.recording.t[ticks], record.published[ticks, :n_p].astype(np.float64), se, alarm)
