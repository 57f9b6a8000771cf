"""What the weak identifier's design for a described mechanism is, and which errors it predicts, before it is built."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.configuration.weak import design_for_recording
from pvid.configuration.weak_tables import for_core
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import names as names_of_shipped
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.choice import Scored, ranked, score_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import ready
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation


@dataclass(frozen=True, eq=False)
class DesignReport:
    """A design of the identifier on a run.

    Attributes
    ----------
    model : of the mechanism
    chosen : design, p and predicted errors
    duration : of the run [s]
    """

    model: CompiledModel
    chosen: Scored
    duration: float

    @property
    def delay_s(self) -> float:
        """From the middle of a window to its estimate, at most: half a window, then the work of another half [s]."""
        return self.chosen.design.window_s

    def facts(self) -> list[tuple[str, str]]:
        """What the design consists of, in words."""
        design = self.chosen.design
        return [
            ("window", f"{design.window_s:.4g} s, an estimate every {design.window_s / 2:.4g} s"),
            ("test functions", f"{design.functions} of sin^{design.power}"),
            ("steps", f"{2 * design.hop} a window, one every {design.decimation} samples"),
            ("derivatives", f"over {1000 * design.rate_taps / design.sample_rate:.3g} ms"),
            ("delay", f"at most {self.delay_s:.3g} s from the middle of a window to its estimate"),
        ]

    def as_json(self) -> dict[str, Any]:
        """The object of `design --model --json`."""
        design, found = self.chosen.design, self.chosen
        units = {one.name: one.unit for one in self.model.unknowns}
        return {
            "model": self.model.name,
            "duration_s": self.duration,
            "parameters": {
                name: {"value": float(found.p[k]), "se": float(found.error[k]), "unit": units[name]}
                for k, name in enumerate(self.model.p_names)
            },
            "identified": found.known,
            "window_s": design.window_s,
            "functions": design.functions,
            "power": design.power,
            "decimation": design.decimation,
            "rate_taps": design.rate_taps,
            "delay_s": self.delay_s,
        }


def report_for_recording(compiled: CompiledModel, recording: Recording) -> DesignReport:
    """The design that `identify --core f32` and `model build --run` choose for a recording.

    Raises PvidError when the recording is too short, or the identifier does not have what the model needs.
    """
    chosen = design_for_recording(ready(compiled), recording.signals, recording.sample_rate)
    return DesignReport(compiled, chosen, len(recording) / recording.sample_rate)


def report_for_rig(compiled: CompiledModel) -> DesignReport:
    """The design of a shipped mechanism's simulated rig. Raises PvidError where the mechanism has none."""
    if compiled.name not in names_of_shipped():
        raise PvidError(f"{compiled.name} has no simulated rig: give a recorded run, --run RUN")
    rig = simulated_rig(compiled.name)
    simulation = RigSimulation.of(compiled, rig)
    run = simulation.run()
    design = for_core(WeakDesign(rig.sample_rate, rig.window_s, **rig.design))  # type: ignore[arg-type]
    found = score_of(ready(simulation.model), run, design, np.asarray(simulation.truth), False)
    assert found is not None  # a rig that is shipped has a design that suits it
    return DesignReport(compiled, found, rig.duration)


def designs_tried(compiled: CompiledModel, recording: Recording) -> tuple[list[Scored], Scored]:
    """Designs of the analysis in float64, the best first, and the one that the identifier gets.

    Raises PvidError when the recording is too short.
    """
    model, rate = ready(compiled), recording.sample_rate
    ranking = ranked(model, recording.signals, rate)
    return ranking, design_for_recording(model, recording.signals, rate, ranking)
