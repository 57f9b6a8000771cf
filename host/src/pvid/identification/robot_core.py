"""The answer of a robot's recording by the C core of pvid/robot.h."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.rounding import percent
from pvid.base.wording import listed
from pvid.codegen.files_robot import RobotFiles, refuse_in_c
from pvid.codegen.robot_library import RobotNative
from pvid.configuration.robot_core import robot_core_design
from pvid.identification.robot import RobotAnswer, answer_of_robot, values_of
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.front import samples_of, segments_of
from pvid.oracle.weak.robot import RobotRun
from pvid.oracle.weak.verdict import Reason, Verdict
from pvid.rig.run import Recording
from pvid.settings.enums import Reason as CoreReason

Float32 = npt.NDArray[np.float32]

_CLASH = 4.0  # joint standard errors, of up to 64 parameters
_MOST_REFUSED = 0.01
_BEYOND = (CoreReason.REJECTED_SATURATED, CoreReason.REJECTED_NOT_FINITE)


@dataclass(frozen=True, eq=False)
class RobotCoreAnswer(RobotAnswer):
    """As RobotAnswer, with p and its covariance from the core; gains, missing terms and doubts from float64.

    Attributes
    ----------
    number : of estimates that the core published
    halves_known : each half of the recording alone has an estimate
    apart : base parameters of which the core and float64 are further apart than their standard errors explain
    refused : part of the samples' ticks whose sample or row is beyond what float32 takes
    """

    number: int = 0
    halves_known: bool = False
    apart: tuple[str, ...] = ()
    refused: float = 0.0

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        return "base parameters, weak form, C core in float32"

    @property
    def method(self) -> list[str]:
        """Of the core."""
        return [f"{self.number} estimates of the core; doubts are those of float64"]

    @cached_property
    def prediction(self) -> tuple[SensorPrediction, ...]:
        """See RobotAnswer; none where a half has no estimate."""
        return super().prediction if self.halves_known else ()

    @cached_property
    def verdict(self) -> Verdict:
        """See RobotAnswer; not identified without an estimate."""
        if not self.number:
            text = (
                f"the core has no estimate: {percent(self.refused)} of its rows are beyond its range: is a column "
                "in another unit?"
                if self.refused > _MOST_REFUSED
                else "the core has no estimate: some standard error is not below half of that of the start: record "
                "longer, and move all joints; or the angles are many turns from 0"
            )
            return Verdict((Reason("not_identified", text),))
        reasons = super().verdict.reasons
        if self.apart:
            text = (
                f"the C core and the float64 analysis disagree on {listed(self.apart)}: most of what determines them "
                "may be noise of the encoders"
            )
            reasons = (*reasons, Reason("core", text, of=self.apart))
        return Verdict(reasons)

    def as_json(self) -> dict[str, Any]:
        """See RobotAnswer."""
        return super().as_json() | {"core": "f32", "estimates": self.number}


def answer_of_robot_in_c(recording: Recording, model: CompiledModel) -> RobotCoreAnswer:
    """As answer_of_robot, by the core with the design that `pvid model build --run` has from the recording.

    Raises PvidError also where there is no C compiler, or the core does not take the robot.
    """
    refuse_in_c(model)
    answer = answer_of_robot(recording, model)
    samples, design = samples_of_core(answer.fit.run, recording), robot_core_design(model, recording)

    def played(own: Float32) -> tuple[RobotNative, npt.NDArray[np.uint8]]:
        native = RobotNative(model, design)
        return native, native.run(own)[0]

    whole, reasons = played(samples)
    found = np.flatnonzero(reasons == CoreReason.UPDATED)
    end = int(found[-1]) + 1 if len(found) else 0
    p, _, number = whole.read()
    halves = [played(one)[0].read() for one in np.array_split(samples, 2)]
    again = RobotNative(model, design)
    again.run(samples[:end])
    covariance = again.covariance() if end else np.zeros((again.p, again.p), np.float32)
    assert covariance is not None  # of the tick of an estimate
    fit = replace(
        answer.fit,
        p=p.astype(np.float64),
        covariance=covariance.astype(np.float64),
        halves=np.array([one[0] for one in halves], np.float64),
        undetermined=answer.fit.undetermined | (number == 0),
    )
    joint = np.sqrt(np.diag(answer.fit.covariance) + np.diag(fit.covariance))
    apart = np.flatnonzero(~fit.undetermined & (np.abs(answer.fit.p - fit.p) > _CLASH * joint))
    return RobotCoreAnswer(
        model,
        fit,
        values_of(model, fit),
        recording,
        number=number,
        halves_known=all(one[2] for one in halves),
        apart=tuple(model.p_names[k] for k in apart),
        refused=float(np.isin(reasons, _BEYOND).mean()),
    )


def samples_of_core(run: RobotRun, recording: Recording) -> Float32:
    """Samples [ticks, 2 n] of a recording as the core takes them: angles without jumps of a turn, NaN where one is
    missing."""
    model, names = run.model, RobotFiles(run.model, "").samples
    given = samples_of(model, recording.run)
    out = np.full((len(recording), len(names)), np.nan, np.float32)
    for part, positions in zip(segments_of(given), run.positions, strict=True):
        torques = [given[one][part] for one in names[len(positions) :]]
        out[part] = np.array([*positions, *torques]).T
    return out
