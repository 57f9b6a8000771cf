"""Settings of the strong form in float32 from a rig file. All defaults that depend on the rig are here."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.fir import FirBank, finite_difference, savitzky_golay
from pvid.rig.file import RigFile
from pvid.settings.bounds import MAX_WINDOW
from pvid.settings.enums import Law
from pvid.settings.f32 import EstimatorConfig, GateConfig, StrongConfig

# The start is a rough guess with an error of up to 50 %; the bounds are a factor of 20 away.
START_RELATIVE_SD = 0.5
BOUND_FACTOR = 20.0

# Rough size of Y - N^T theta relative to w^4 [rad/s^8]; through H0 it affects only the first ticks.
ROW_SD_OF_W4 = 0.1

LAWS = {"stationary": Law.STATIONARY, "pseudovelocity": Law.PSEUDOVELOCITY}


def nominal_start(rig: RigFile) -> npt.NDArray[np.float64]:
    """The mapped parameters, p = (w, d1, d2), of the rig file's rough guess."""
    mechanism = rig.mechanism
    return mechanism.mapped([getattr(rig.nominal, name) for name in mechanism.model.physical_names])


def bank_of(rig: RigFile, sample_rate: float) -> FirBank:
    """The FIR bank of a rig file at `sample_rate` [Hz]."""
    settings = rig.identifier
    if settings.differentiator == "finite-difference":
        if settings.block > 1:
            raise PvidError("[identifier] block is of the Savitzky-Golay filters: omit it with finite differences")
        bank = finite_difference(settings.stride)
    else:
        apart = settings.stride * settings.block
        taps = max(round(settings.strong_window_s * sample_rate / apart), settings.degree + 1)
        bank = savitzky_golay(taps | 1, settings.degree, settings.stride, settings.block)
    if bank.memory > MAX_WINDOW:
        raise PvidError(
            f"the differentiator's window is {bank.memory} points at {sample_rate:g} Hz and the core holds "
            f"{MAX_WINDOW} (PVID_MAX_WINDOW): shorten window_s or set a block"
        )
    return bank


def estimator_config(rig: RigFile, bank: FirBank, start: npt.ArrayLike | None = None) -> EstimatorConfig:
    """Settings of the strong form's estimator; `start` overrides the nominal p."""
    settings = rig.identifier
    p = np.asarray(nominal_start(rig) if start is None else start, np.float64)
    return EstimatorConfig(
        start=p.astype(np.float32),
        start_sd=(START_RELATIVE_SD * p).astype(np.float32),
        lower=(p / BOUND_FACTOR).astype(np.float32),
        upper=(p * BOUND_FACTOR).astype(np.float32),
        row_sd=ROW_SD_OF_W4 * float(p[0]) ** 4,
        forgetting_s=settings.forgetting_s,
        feedback_hz=settings.feedback_hz,
        # rows closer than the bank's reach share samples: count half a window as one row
        correlation=float(max(bank.half, 1)),
        kappa_min=settings.kappa_min,
        law=LAWS[settings.law],
        dead_zone=settings.dead_zone,
        divider=settings.divider,
    )


def drive_threshold(rig: RigFile, bank: FirBank, sample_rate: float) -> float:
    """Rms of u [1/s^2] below which the pivot counts as still: ten times the noise of u with a still sensor.

    The sensor's noise is taken as half an LSB (rounding, 0.29 LSB, and somewhat more of its own); without a
    resolution in the rig file, a thousandth of w.
    """
    weights = bank.weights[2]
    white_gain = np.sqrt(2 * np.sum(weights**2) + 4 * np.sum(weights) ** 2)
    rate = sample_rate / (bank.stride * bank.block)
    noise = 0.5 * rig.sensor.y_lsb / math.sqrt(bank.block) * white_gain * rate**2 / rig.l1
    return float(max(10 * noise, 1e-3 * nominal_start(rig)[0]))


def gate_config(rig: RigFile) -> GateConfig:
    """The outlier gate of a rig file."""
    return GateConfig(rig.identifier.gate, rig.identifier.patience_s or 0.0)


def strong_config(rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> StrongConfig:
    """Settings of the strong-form identifier for samples at `sample_rate` [Hz]."""
    bank = bank_of(rig, sample_rate)
    return StrongConfig(
        sample_rate=sample_rate,
        l1=rig.l1,
        drive_min=drive_threshold(rig, bank, sample_rate),
        weights=bank.weights32,
        stride=bank.stride,
        block=bank.block,
        gate=gate_config(rig),
        estimator=estimator_config(rig, bank, start),
    )


# Noise of a sensor in LSB: rounding, and half an LSB of its own.
NOISE_LSB = float(np.sqrt(1 / 12 + 1 / 4))


def row_sd_of(rig: RigFile, decimation: int) -> float:
    """Noise of a decimated angle [rad]: white noise of the samples, whose variance decimation divides by its factor.

    An exact sensor has the noise of float32.
    """
    return max(rig.sensor.phi_lsb * NOISE_LSB, 1e-8) / math.sqrt(decimation)
