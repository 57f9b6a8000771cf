"""The outlier gate: its bits, what it keeps out, what it lets in again, and where it is on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_rig import LINEAR_RIG
from strong_lanes import strong_lanes

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import first_difference
from pvid.settings.enums import Reason, Status
from pvid.settings.f32 import GateConfig
from pvid.setup.f32 import strong_config, weak_config
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start
from pvid.twin.f32.gate import Gate
from pvid.twin.weak import WeakTwin

RIG = LINEAR_RIG
OUTLIER = Reason.REJECTED_OUTLIER


def rig_with(**identifier: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **identifier))


@pytest.fixture(scope="module")
def jolted() -> Run:
    """40 s of the standard rig, 14 bits; at 25 s somebody touches it, at 30 s the encoder sticks."""
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=40.0, seed=1).run
    phi = run.phi.copy()
    phi[25_000:25_600] += 0.02 * np.sin(np.pi * np.arange(600) / 600) ** 2
    phi[30_000:30_300] = phi[30_000]
    return replace(run, phi=phi)


# ---- the rule itself ----


def gate(sigmas: float, patience_s: float = 0.0, memory: float = 10.0, floor: float = 1.0) -> Gate:
    rate = np.float32(100.0)
    return Gate(GateConfig(sigmas, patience_s), rate, np.float32(memory), np.array([floor], np.float32))


def feed(one: Gate, square: float, times: int) -> int:
    """How many of them pass."""
    return sum(bool(one.passes(np.array([square], np.float32))[0]) for _ in range(times))


def test_gate_passes_everything_while_warming_up() -> None:
    assert feed(gate(4.0), 1e9, 10) == 10


def test_residual_beyond_the_limit_is_rejected() -> None:
    one = gate(4.0)
    feed(one, 100.0, 40)
    assert feed(one, 15.9 * 100.0, 1) == 1
    one = gate(4.0)
    feed(one, 100.0, 40)
    assert feed(one, 16.2 * 100.0, 100) == 0


def test_scale_is_never_below_its_floor() -> None:
    one = gate(4.0, floor=1.0)
    assert feed(one, 0.0, 1000) == 1000
    assert feed(one, 15.9, 1) == 1
    assert feed(one, 1e3, 10) == 0


def test_outliers_are_rejected_and_a_lasting_change_is_accepted() -> None:
    never, later = gate(4.0), gate(4.0, patience_s=3.0)
    for one in (never, later):
        feed(one, 1.0, 100)
    assert feed(never, 1e4, 100_000) == 0
    # the scale of squares grows by 1e4 in 3 s, 300 residuals; it needs 1e4 / 16
    refused = 0
    while feed(later, 1e4, 1) == 0:
        refused += 1
    assert refused == pytest.approx(300 * np.log(1e4 / 16) / np.log(1e4), rel=0.03)


def test_one_percent_of_outliers_barely_widens_the_scale() -> None:
    one = gate(4.0, patience_s=10.0)
    feed(one, 1.0, 100)
    for _ in range(200):
        feed(one, 1.0, 99)
        assert feed(one, 1e4, 1) == 0
    assert float(one.scale[0]) < 1.2


@settings(deadline=None)
@given(squares=st.lists(st.floats(0, 1e38), max_size=60), patience=st.floats(0, 1e6))
def test_gate_scale_stays_finite(squares: list[float], patience: float) -> None:
    one = gate(4.0, patience)
    for square in squares:
        feed(one, square, 1)
        assert 1.0 <= one.scale[0] <= np.float32(1e30)
    assert feed(one, float("nan"), 1) == 1
    assert feed(one, float("inf"), 1) == 1


# ---- in the identifiers ----


@pytest.mark.parametrize("patience_s", [0.0, 2.0])
@pytest.mark.parametrize("correction", [False, True])
def test_the_weak_form_equals_its_twin(
    patience_s: float, correction: bool, matrix: dict[str, Native], jolted: Run
) -> None:
    rig = rig_with(outlier_gate=4.0, outlier_patience_s=patience_s, full_angle=correction, damping=correction)
    config = weak_config(rig, 1000.0)
    twin = WeakTwin(config)
    expected = twin.run(jolted.phi, jolted.y)
    for native in matrix.values():
        core = native.identifier(config)
        record = core.run(jolted.phi, jolted.y, hashes=False)
        assert first_difference(record, expected.lane()) is None, native.build
        assert core.counters == {name: int(of[0]) for name, of in twin.estimator.counters.items()}
        assert core.counters["rejected_outlier"] > 0
        assert (record.reason == OUTLIER).sum() == core.counters["rejected_outlier"]


def test_the_strong_form_equals_its_twin_in_every_lane(matrix: dict[str, Native], jolted: Run) -> None:
    phi, y = jolted.phi[22_000:32_000], jolted.y[22_000:32_000]
    rig = rig_with(form="strong", stride=8, outlier_gate=6.0, outlier_patience_s=5.0)
    config = strong_config(rig, 1000.0)
    lanes = [replace(config.estimator, forgetting_s=tau, feedback_hz=f) for tau in (0.0, 2.0) for f in (0.0, 10.0)]
    for counters, reason in strong_lanes(config, lanes, phi, y, matrix):
        assert counters["rejected_outlier"] == (reason == OUTLIER).sum() > 0


def test_disturbed_windows_are_rejected(native: Native, jolted: Run) -> None:
    errors = {}
    for sigmas in (0.0, 4.0):
        core = native.identifier(weak_config(rig_with(outlier_gate=sigmas), 1000.0))
        record = core.run(jolted.phi, jolted.y, sums=False)
        errors[sigmas] = np.abs(record.published[-1, :3] / STANDARD_PENDULUM.linear - 1).max()
        refused = np.flatnonzero(record.reason == OUTLIER)
        # each lies in two or three windows of 1.71 s, and nothing else is refused
        assert len(refused) == 0 if sigmas == 0.0 else 4 <= len(refused) <= 6
        assert np.isin(refused // 1000, (25, 26, 27, 30, 31, 32)).all()
    assert errors[4.0] < 5e-4 < errors[0.0]


def test_a_refused_window_changes_nothing_but_its_counter(native: Native, jolted: Run) -> None:
    core = native.identifier(weak_config(rig_with(outlier_gate=4.0), 1000.0))
    record = core.run(jolted.phi, jolted.y)
    for tick in np.flatnonzero(record.reason == OUTLIER):
        assert np.array_equal(record.p[tick - 300], record.p[tick])
        assert np.array_equal(record.sums[tick - 300], record.sums[tick])


def test_gate_is_enabled_in_the_stationary_law_and_can_be_disabled(native: Native, jolted: Run) -> None:
    for form, sigmas in (("weak", 4.0), ("strong", 6.0)):
        of = weak_config if form == "weak" else strong_config
        assert of(rig_with(form=form, stride=8), 1000.0).gate == GateConfig(sigmas, 0.0)
        assert of(rig_with(form=form, stride=8, law="pseudovelocity"), 1000.0).gate == GateConfig(0.0, 0.0)
        assert of(rig_with(form=form, stride=8, outlier_gate=0.0), 1000.0).gate == GateConfig(0.0, 0.0)
    assert (native.identifier(weak_config(RIG, 1000.0)).run(jolted.phi, jolted.y).reason == OUTLIER).any()
    off = native.identifier(weak_config(rig_with(outlier_gate=0.0), 1000.0))
    assert not (off.run(jolted.phi, jolted.y).reason == OUTLIER).any()


@pytest.mark.parametrize("seed", range(3))
def test_gate_rejects_nothing_of_a_regular_run(seed: int, native: Native) -> None:
    # 40 s from a start that is half wrong: the same bits with the gate and without it
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=40.0, seed=seed).run
    hashes = []
    for sigmas in (0.0, 4.0):
        core = native.identifier(weak_config(rig_with(outlier_gate=sigmas), 1000.0, standard_start(seed)))
        core.run(run.phi, run.y, sums=False)
        assert core.counters["rejected_outlier"] == 0
        hashes.append(core.running_hash)
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("form", ["weak", "strong"])
@pytest.mark.parametrize(
    ("gate_config", "status"),
    [
        (GateConfig(1.9), Status.BAD_GATE_SIGMAS),
        (GateConfig(-1.0), Status.BAD_GATE_SIGMAS),
        (GateConfig(1.1e3), Status.BAD_GATE_SIGMAS),
        (GateConfig(float("nan")), Status.BAD_GATE_SIGMAS),
        (GateConfig(4.0, -1.0), Status.BAD_GATE_PATIENCE),
        (GateConfig(4.0, float("inf")), Status.BAD_GATE_PATIENCE),
    ],
)
def test_invalid_gate_is_refused(form: str, gate_config: GateConfig, status: Status, native: Native) -> None:
    with pytest.raises(PvidError, match=status.name.lower().replace("_", " ")):
        if form == "weak":
            native.identifier(replace(weak_config(RIG, 1000.0), gate=gate_config))
        else:
            native.identifier(replace(strong_config(rig_with(form="strong", stride=8), 1000.0), gate=gate_config))
