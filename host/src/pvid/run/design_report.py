"""Prediction for a weak-form design: standard errors, kappa, and its cost on a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.design.weak import WeakDesign
from pvid.design.weak_cost import WeakCost, cost_of
from pvid.oracle.weak import Prediction, WeakSettings, identify_weak, predict, predict_rig
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.identify import WORST_SE
from pvid.run.survey import fitted
from pvid.setup.f32 import weak_config, weak_design_of
from pvid.sim.pendulum import Drive, Pendulum, Sensors, Tone

# White noise of the sensors beside their rounding [LSB]: that of the standard rig (theory.md 6). The rig file holds
# resolutions only.
PHI_NOISE_LSB, Y_NOISE_LSB = 0.5, 0.4


@dataclass(frozen=True)
class DesignReport:
    """What a design promises.

    Attributes
    ----------
    design : the tables
    duration : of the run that is predicted [s]
    value, se : published parameters, and physical ones, that the prediction is made at, and standard errors
    kappa : part of the first parameter's information that the others cannot imitate
    row_sd : noise of a row [rad]
    cost : on a device
    """

    design: WeakDesign
    duration: float
    value: dict[str, float]
    se: dict[str, float]
    kappa: float
    row_sd: float
    cost: WeakCost

    def as_json(self) -> dict[str, Any]:
        """The object of `design --json`."""
        tables, cost = self.design, self.cost
        return {
            "duration_s": self.duration,
            **{name: {"value": self.value[name], "se": self.se[name]} for name in self.value},
            "kappa": self.kappa,
            "row_sd_rad": self.row_sd,
            "delay_s": cost.delay_s,
            "update_s": cost.update_s,
            "flash_bytes": cost.flash_bytes,
            "ram_bytes": cost.ram_bytes,
            "raised": list(cost.raised),
            "ram_bytes_fitted": cost.ram_bytes_fitted,
            "definitions": list(cost.definitions),
            "instructions": round(cost.instructions),
            "longest_tick": round(cost.longest_tick),
            "taps": tables.taps,
            "decimation": tables.decimation,
            "window": tables.window,
            "functions": tables.functions,
        }

    def cost_rows(self) -> list[tuple[str, str]]:
        """What it costs, in words."""
        tables, cost = self.design, self.cost

        def size(ram_bytes: int | None) -> str:
            return "unknown (this gcc has no 32-bit mode)" if ram_bytes is None else f"{ram_bytes} bytes"

        raised = f" but -D{' -D'.join(cost.raised)}" if cost.raised else ""
        return [
            (
                "tables",
                f"{tables.taps} taps, decimation {tables.decimation}, windows of {tables.window} samples "
                f"({tables.window_s:g} s), {tables.functions} test functions",
            ),
            ("delay", f"{cost.delay_s:.3g} s from a sample to the last estimate it enters, at most"),
            ("estimates", f"one every {cost.update_s:.3g} s"),
            ("flash", f"{cost.flash_bytes} bytes of tables"),
            ("RAM", f"{size(cost.ram_bytes)} with the default bounds of pvid/config.h{raised}, on a 32-bit device"),
            ("RAM, fitted", f"{size(cost.ram_bytes_fitted)} with -D{' -D'.join(cost.definitions)}"),
            (
                "instructions",
                f"{cost.instructions:.0f} a sample, {cost.longest_tick:.0f} in the longest tick "
                f"(formula fitted to counts on x86-64, gcc -O2; without the correction of large angles)",
            ),
        ]


def sensors_of(rig: RigFile) -> Sensors:
    """The rig file's sensors, with the noise that the standard rig's have."""
    sensor = rig.sensor
    return Sensors(phi_lsb=sensor.phi_lsb, phi_noise_lsb=PHI_NOISE_LSB, y_lsb=sensor.y_lsb, y_noise_lsb=Y_NOISE_LSB)


def report_for_tones(
    rig: RigFile,
    tones: Sequence[Tone],
    release: tuple[float, float],
    duration: float,
) -> DesignReport:
    """For a simulated run of `duration` [s] of the nominal rig, driven by tones and released at rest.

    Raises
    ------
    PvidError
        When the rig file does not suffice, the run does not fill a window or the drive does not excite w.
    """
    _refuse_exact(rig)
    if rig.sample_rate is None:
        raise PvidError("sample_rate is required in the rig file to compute the tables")
    design = weak_design_of(rig, rig.sample_rate)
    nominal = Pendulum.nominal(rig)
    drive, settings = Drive(tuple(tones)), rig.identifier
    prediction = predict_rig(
        design, nominal, drive, sensors_of(rig), duration, release, settings.zero, settings.forgetting_s
    )
    return _report(rig, design, prediction, duration)


def report_for_run(rig: RigFile, run: Run, duration: float | None = None) -> DesignReport:
    """For a recorded run, or one of `duration` [s] that goes on as the run does.

    Of the tables that identify takes for this run. The prediction is made at what the run identifies, or at the nominal
    where that is nothing.
    """
    _refuse_exact(rig)
    rig = fitted(rig, run)
    design = weak_design_of(rig, run.sample_rate)
    config = weak_config(rig, run.sample_rate)
    settings = WeakSettings(config.estimator.start.astype(np.float64), config.estimator.row_sd)
    last = identify_weak(run.phi, run.y, design, settings).last
    found = bool((last.p[: rig.mechanism.model.n_mapped] > 0).all()) and last.se[0] < WORST_SE * last.p[0]
    p = last.p if found else settings.start
    prediction = predict(run.phi, run.y, design, p, sensors_of(rig), rig.identifier.forgetting_s)
    recorded = len(run.t) / run.sample_rate
    return _report(rig, design, prediction, recorded, duration)


def _refuse_exact(rig: RigFile) -> None:
    if rig.sensor.phi_lsb == 0.0:
        raise PvidError("phi_lsb is 0 in the rig file: errors can be predicted for an encoder with a resolution only")


def _report(
    rig: RigFile,
    design: WeakDesign,
    prediction: Prediction,
    recorded: float,
    duration: float | None = None,
) -> DesignReport:
    p, covariance = prediction.p, prediction.covariance
    if duration is not None:
        covariance = covariance * (recorded / duration)
    settings = rig.identifier
    corrected = settings.core == "f32" and (settings.full_angle or settings.damping)
    mechanism = rig.mechanism
    model = mechanism.model
    names = model.p_names[: len(p)]
    value = dict(zip(names, map(float, p), strict=True))
    se = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    physical = mechanism.physical(p)
    if np.isfinite(physical).all():
        errors = mechanism.physical_errors(p, covariance)
        value.update(zip(model.physical_names, map(float, physical), strict=True))
        se.update(zip(model.physical_names, map(float, errors), strict=True))
    return DesignReport(
        design=design,
        duration=recorded if duration is None else duration,
        value=value,
        se=se,
        kappa=prediction.kappa,
        row_sd=prediction.row_sd,
        cost=cost_of(design, rig.identifier.zero, corrected=corrected),
    )
