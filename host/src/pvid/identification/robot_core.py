"""The answer of a robot's recording by the C core of pvid/robot.h."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

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


@dataclass(frozen=True, eq=False)
class RobotCoreAnswer(RobotAnswer):
    """As RobotAnswer, with p and its covariance from the core; gains, missing terms and doubts from float64.

    Attributes
    ----------
    number : of estimates that the core published
    halves_known : each half of the recording alone has an estimate
    """

    number: int = 0
    halves_known: bool = False

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
        text = (
            "the core has no estimate: some standard error is not below half of that of the start: record longer, and "
            "move all joints"
        )
        return super().verdict if self.number else Verdict((Reason("not_identified", text),))

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

    def last(own: Float32) -> tuple[RobotNative, int]:
        native = RobotNative(model, design)
        reasons = native.run(own)[0]
        found = np.flatnonzero(reasons == CoreReason.UPDATED)
        return native, int(found[-1]) + 1 if len(found) else 0

    whole, end = last(samples)
    p, _, number = whole.read()
    halves = [last(one)[0].read() for one in np.array_split(samples, 2)]
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
    return RobotCoreAnswer(
        model, fit, values_of(model, fit), recording, number=number, halves_known=all(one[2] for one in halves)
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
