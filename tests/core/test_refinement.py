"""The refinement of the library's pendulum, stepped by itself, whatever the samples.

Its bits are those of the twin with the first stage: tests/twin/test_second_stage.py.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pendulum_plant import STANDARD_PENDULUM, Sensors, simulate, standard_sensors

from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import refine_settings
from pvid.core.native import Native
from pvid.core.refine_native import RefineNative, RefineRecord
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig

Float = npt.NDArray[np.float64]
TRUTH = STANDARD_PENDULUM.linear
BLOCK_S = 3.0  # two periods of the slow mode
BEFORE = 500  # ticks before the weak form's first estimate


@cache
def samples(duration: float, angle: float) -> Float:
    """y, phi of the standard rig, 14 bits, full equations [ticks, 2]."""
    truth = simulate(sensors=Sensors(), truth="full", release=(0.06 * angle, 0.14 * angle), duration=duration)
    phi, y = standard_sensors().measure(truth.state[:, 1] - truth.state[:, 0], truth.run.y, 0)
    return np.stack([y, phi], axis=1)


def configuration(**changes: Any) -> RefineConfig:
    """Of the standard rig."""
    return replace(settings_for(), **changes)


@cache
def settings_for(bits: int = 14) -> RefineConfig:
    """Of the standard rig with such an encoder."""
    rig = MechanismRig("kapitza", sensor={"phi": {"resolution": 2 * np.pi / 2**bits}})
    y, phi = samples(9.0, 2.0).T
    return refine_settings(refine_functions(rig.compiled()), {"y": y, "phi": phi}, 1000.0, [*TRUTH, 0.0], BLOCK_S)


def weak(ticks: int, off: tuple[float, float, float]) -> tuple[Float, Float]:
    """Estimates of a weak form: the truth times 1 + off."""
    p = np.tile(np.append(TRUTH * (1 + np.array(off)), 0.0), (ticks, 1))
    p[:BEFORE] = np.nan
    return p, np.full((ticks, 4), 0.5)


def played(given: Float, config: RefineConfig, off: tuple[float, float, float]) -> RefineRecord:
    return RefineNative(Native(), config).run(given, *weak(len(given), off))


def test_faults_of_all_kinds() -> None:
    """Outliers, a stuck encoder, missing samples of both sensors, a jump of the offset."""
    given = samples(9.0, 2.0).copy()
    given[1000:1400:37, 1] += 0.05
    given[2000:2300, 1] = given[2000, 1]
    given[3500:3520, 1] = np.nan
    given[6000:6003, 0] = np.nan
    given[7000:, 1] += 0.03
    core = played(given, configuration(forgetting_s=10.0), (0.03, -0.03, 0.03))
    assert Reason.REJECTED_NOT_FINITE in core.reason


def wild(given: Float, sizes: tuple[float, float], every: int) -> Float:
    """With a wild sample of y or of phi, in turn; they fall on every place of a mean."""
    spoilt = given.copy()
    hit = np.arange(700, len(given), every)
    spoilt[hit, np.arange(len(hit)) % 2] += np.where(np.arange(len(hit)) % 4 < 2, 1, -1) * np.resize(sizes, len(hit))
    return spoilt


def test_a_drive_beyond_its_range_begins_anew() -> None:
    """The pivot jumps by 0.3 m: its second derivative is far beyond the range while the filter sees the jump."""
    given = samples(12.0, 2.0).copy()
    given[4000:, 0] += 0.3
    core = played(given, configuration(), (0.01, -0.01, 0.01))
    assert Reason.REJECTED_NOT_FINITE in core.reason[4000:4300]
    assert Reason.UPDATED in core.reason[4300:]
    assert np.max(np.abs(core.r[-1, :3] / TRUTH - 1)) < 2e-3


@pytest.mark.parametrize("gate", [0.0, 2.0, 4.0])
def test_wild_samples(gate: float) -> None:
    """1.9 rad and 25 mm every half second: without the gate no block fits."""
    given = wild(samples(9.0, 2.0), (0.025, 1.9), 501)
    core = played(given, configuration(outlier_gate=gate), (0.01, -0.01, 0.01))
    assert (Reason.UPDATED in core.reason) == (gate > 0)
    if gate > 0:
        assert np.max(np.abs(core.r[-1, :3] / TRUTH - 1)) < 2e-3


def test_jumps_and_kinks_are_no_wild_samples() -> None:
    """A pivot that reverses sharply, an offset that jumps, motion after standstill: all as without the gate."""
    given = samples(6.0, 1.0).copy()
    t = np.arange(len(given)) / 1000.0
    given[:, 0] += 0.02 * np.abs(np.mod(t, 1.4) - 0.7)
    given[4000:, 1] += 0.3
    given[:1500] = given[1500]
    found = [played(given, configuration(outlier_gate=gate), (0.0, 0.0, 0.0)).hash for gate in (0.0, 4.0)]
    np.testing.assert_array_equal(found[0], found[1])


def test_a_start_from_which_nothing_converges() -> None:
    core = played(samples(6.0, 2.0), configuration(), (0.6, -0.3, -0.3))
    assert Reason.HELD_SEARCHING in core.reason


@pytest.mark.parametrize("bits", [12, 16])
def test_the_truth_is_within_its_standard_errors(bits: int) -> None:
    """Sharp enough to be wrong: at 16 bits 3 se are some 1e-4."""
    truth = simulate(sensors=Sensors(), truth="full", duration=20.0)
    phi, y = standard_sensors(bits).measure(truth.state[:, 1] - truth.state[:, 0], truth.run.y, 1)
    native = RefineNative(Native(), settings_for(bits))
    record = native.run(np.stack([y, phi], axis=1), *weak(len(phi), (0.02, 0.02, -0.02)))
    error = np.abs(record.r[-1] - [*TRUTH, 0, 0, 0, 0])[:6]
    assert np.all(record.se[-1, :6] > 0)
    assert np.all(error < 3.5 * record.se[-1, :6])
    assert record.se[-1, 0] / TRUTH[0] < {12: 3e-3, 16: 2e-4}[bits]
