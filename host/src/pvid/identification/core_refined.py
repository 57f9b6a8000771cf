"""Both stages in C on a recording of a described mechanism: the refined estimate, and the twin of the second stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import RefineFunctions, refine_functions
from pvid.codegen.weak_library import weak_native, weak_sources
from pvid.compare.bits import Comparison, Difference
from pvid.compare.weak import compare_samples
from pvid.configuration.refine import refine_design
from pvid.configuration.weak import config_to_identify, samples_of
from pvid.core.weak_native import RefinedIdentifier, RefinedRecord
from pvid.identification.answer import Analysis, Answer, Value
from pvid.identification.core import CoreAnswer
from pvid.identification.values import refined_gains_of, refined_shifts_of, values_of
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.verdict import Reason as Doubt
from pvid.oracle.weak.verdict import Verdict
from pvid.rig.run import Recording
from pvid.settings.cores import FLOAT
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import Float32, WeakConfig
from pvid.twin.printed import PrintedTwin

if TYPE_CHECKING:
    from pvid.identification.validation import Validation


@dataclass(frozen=True, eq=False)
class BothStages:
    """Both stages for a recording.

    Attributes
    ----------
    made : functions of the refinement
    config, settings : of the weak form and of the refinement
    samples : as the core gets them [ticks, samples]
    """

    model: CompiledModel
    made: RefineFunctions
    config: WeakConfig
    settings: RefineConfig
    samples: Float32

    @classmethod
    def of(cls, model: CompiledModel, recording: Recording, config: WeakConfig) -> BothStages:
        """PvidError where the refinement in C does not have what the model needs."""
        settings = refine_design(model, config, recording.signals)
        return cls(model, refine_functions(model), config, settings, samples_of(config, recording.signals))

    def run(self) -> tuple[RefinedIdentifier, RefinedRecord]:
        """The C core after the recording, and what it did."""
        native = weak_native(self.model, self.config.design, self.made)
        identifier = native.refined_of(self.config, self.settings)
        return identifier, identifier.run_both(self.samples)


@dataclass(frozen=True, eq=False)
class RefinedCoreAnswer(Answer):
    """An identification by both stages in C.

    Attributes
    ----------
    model, recording, advice : of the analysis
    weak : of the first stage
    values : by name: outputs of the model, p, then what the refinement has beside p; of the last refined estimate, or
        those of the first stage where there is none
    adopted : whether there is one
    reason : of the refinement's last block
    first_s : time of the first refined estimate [s]
    level, clash : as in pvid/refine.h
    hash : running hash of both stages after the last tick
    record, made : every tick; the functions of the refinement
    covariance : of the last refined estimate, as the core has it; None: there is none
    """

    model: CompiledModel
    recording: Recording
    advice: tuple[str, ...]
    weak: CoreAnswer
    values: Mapping[str, Value]
    adopted: bool
    reason: Reason
    first_s: float | None
    level: float | None
    clash: float | None
    hash: int
    record: RefinedRecord
    made: RefineFunctions
    covariance: npt.NDArray[np.float64] | None

    def history(self) -> list[tuple[float, Mapping[str, Value]]]:
        """Time [s] and values of every refined estimate; correlations are those of the last one."""
        if self.covariance is None:
            return []
        answer, places = self.weak.analysis, list(self.made.places_of_p)
        sd = np.sqrt(np.diag(self.covariance))
        correlation = (self.covariance / np.outer(sd, sd))[np.ix_(places, places)]
        gains = refined_gains_of(answer.model, answer.found)
        r = self.record.r[:, places].astype(np.float64)
        new = np.flatnonzero(np.any(np.diff(r, axis=0) != 0, axis=1)) + 1
        out = list[tuple[float, Mapping[str, Value]]]()
        for tick in new:
            p = r[tick]
            se = self.record.se[tick, places].astype(np.float64)
            values = values_of(
                answer.model, p, correlation * np.outer(se, se), gains, answer.found.judged, answer.found.verdict
            )
            out.append((float(answer.recording.t[tick]), values))
        return out

    @property
    def unseen(self) -> Validation | None:
        """That of the analysis."""
        return self.weak.unseen

    @property
    def identified(self) -> bool:
        """Whether a stage has published, and the recording shows a parameter."""
        return (self.adopted and self.weak.analysis.identified) or self.weak.identified

    @property
    def text(self) -> str:
        """Which estimate it is, in a clause."""
        if not self.adopted:
            own = self.weak.analysis.model.refinement.equations
            beaten = self.reason == Reason.HELD_UNCERTAIN and self.first_s is not None and not own
            why = ", the weak form's standard errors are smaller" if beaten else ""
            return f"not refined: {self.reason.text}{why}; the estimate is that of the weak form"
        held = "" if self.reason == Reason.UPDATED else f", held since: {self.reason.text}"
        return (
            f"refined by the second stage, first after {self.first_s:.3g} s{held}; residual level {self.level:.2g}, "
            f"clash {self.clash:.2g}"
        )

    @property
    def verdict(self) -> Verdict:
        """That of the first stage."""
        return self.weak.verdict

    @property
    def doubts(self) -> Sequence[Doubt]:
        """Those of the first stage, where its values are shown."""
        return () if self.adopted else self.verdict.reasons

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        return f"{'refined' if self.adopted else 'weak form'}, C in {FLOAT.words}"

    @property
    def method(self) -> list[str]:
        """Which estimate it is, and the hash."""
        return [f"{self.text}; hash of both stages {self.hash:08x}"]

    @property
    def why_nothing(self) -> str:
        """The reason of the first stage's last window."""
        return self.weak.reason.text

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        refinement = {
            "adopted": self.adopted,
            "text": self.text,
            "reason": self.reason.text,
            "first_s": self.first_s,
            "level": self.level,
            "clash": self.clash,
        }
        return self.weak.as_json() | super().as_json() | {"hash": f"{self.hash:08x}", "refinement": refinement}


def refined_in_c(weak: CoreAnswer) -> RefinedCoreAnswer:
    """The recording of an identification by the first stage in float32 (identify_in_c), by both stages in C.

    Raises PvidError when there is no C compiler, or the second stage does not have what the model needs.
    """
    answer = weak.analysis
    config = config_to_identify(answer.model, answer.recording, answer.ranking)
    stages = BothStages.of(answer.model, answer.recording, config)
    identifier, record = stages.run()
    last, t = identifier.refined, answer.recording.t
    published = np.flatnonzero(record.told == Reason.UPDATED)
    return RefinedCoreAnswer(
        model=answer.model,
        recording=answer.recording,
        advice=answer.advice,
        weak=weak,
        values=weak.values if last is None else _values(answer, stages.made, last),
        adopted=last is not None,
        reason=Reason(int(record.told[-1])),
        first_s=float(t[published[0]] - t[0]) if len(published) else None,
        level=None if last is None else float(last["level"]),
        clash=None if last is None else float(last["clash"]),
        hash=int(record.hash[-1]),
        record=record,
        made=stages.made,
        covariance=None if last is None else np.asarray(last["covariance"], np.float64),
    )


def _values(answer: Analysis, made: RefineFunctions, estimate: npt.NDArray[np.void]) -> dict[str, Value]:
    """Of the model's outputs and of p; then those that the weak form does not have."""
    parameters = made.parameters
    r = np.asarray(estimate["r"], np.float64)
    unit = np.where([one.log for one in parameters], r, 1.0)
    covariance = np.asarray(estimate["covariance"], np.float64) * np.outer(unit, unit)
    places = made.places_of_p
    model, found, own = answer.model, answer.found, covariance[np.ix_(places, places)]
    gains, shifts = refined_gains_of(model, found), refined_shifts_of(model, found)
    values = values_of(model, r[places], own, gains, found.judged, found.verdict, shifts)
    for k, one in enumerate(parameters):
        if one.place < 0 and answer.identified:
            se = float(np.sqrt(covariance[k, k]))
            values[one.name] = Value(one.unit, float(r[k]), se, se)
    return values


def compare_both(
    model: CompiledModel,
    recording: Recording,
    progress: Callable[[int], None] | None = None,
    ranking: Sequence[Scored] = (),
) -> tuple[Comparison, Comparison | str]:
    """Both stages against their twins, bit for bit, after every tick; in place of the second one why there is none."""
    config = config_to_identify(model, recording, ranking)
    first = compare_samples(model, config, samples_of(config, recording.signals), progress)
    try:
        stages = BothStages.of(model, recording, config)
    except PvidError as error:
        return first, str(error)
    return first, compare_refined(stages, progress)


def compare_refined(stages: BothStages, progress: Callable[[int], None] | None = None) -> Comparison:
    """Both stages against their twin: reason of the last block, r and its standard errors after every tick, the running
    hash of both stages."""
    _, core = stages.run()
    twin = PrintedTwin(weak_sources(stages.model, stages.config.design, stages.made), stages.config, stages.settings)
    own = twin.run(stages.samples, progress)
    second = twin.second
    assert second is not None
    names = [one.name for one in stages.made.parameters]
    compared = {"refined ": (core.r, second.r), "standard error of ": (core.se, second.se)}
    different = np.flatnonzero(core.told != second.told)[:1]
    found = [Difference(int(k), "reason", int(core.told[k]), int(second.told[k])) for k in different]
    for what, (ours, theirs) in compared.items():
        words = ours.view(np.uint32), theirs.view(np.uint32)
        for tick, place in np.argwhere(words[0] != words[1])[:1]:
            one, other = (int(part[tick, place]) for part in words)
            found.append(Difference(int(tick), f"{what}{names[place]}", one, other))
    first = min(found, key=lambda one: one.tick) if found else None
    return Comparison(len(core.told), int(core.hash[-1]), int(own.hash[-1]), first)
