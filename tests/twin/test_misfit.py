"""The strong form's verdict on itself in both cores: its bits, and when it raises the alarm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from lanes import assert_lanes_equal

from pvid.cases import CASES
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Reason
from pvid.setup.f32 import nominal_start, strong_config
from pvid.setup.q31 import counts_of, strong_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, Simulation, simulate, standard_sensors, standard_start
from pvid.twin.kapitza.estimator_q31 import KapitzaEstimatorQ31
from pvid.twin.strong_q31 import StrongTwinQ31

SLOW_HZ = 125.0  # the default filter with one sample in eight: 31 points
CHANGE = 9 * 125  # tick
FINE_BITS = 22
DOUBTED = (Reason.MISFIT, Reason.REJECTED_OUTLIER)
both_cores = pytest.mark.parametrize("core", ("f32", "q31"))


def rig_of(bits: int, core: Any = "q31", **identifier: Any) -> RigFile:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", core=core, **identifier)
    return replace(rig, identifier=settings, sensor=replace(rig.sensor, phi_lsb=standard_sensors(bits).phi_lsb))


def reasons_of(native: Native, rig: RigFile, run: Run) -> npt.NDArray[np.uint8]:
    case = CASES["strong", rig.identifier.core]
    core = native.identifier(case.settings(rig, run.sample_rate))
    return core.run(*case.samples(rig, run), sums=False).reason


@pytest.fixture(scope="module")
def changed() -> Run:
    """30 s at 125 Hz with a fine encoder; after 9 s w is larger by 20 %."""
    sensors = replace(standard_sensors(FINE_BITS), random_offset=False)
    before, after = (
        simulate(
            replace(STANDARD_PENDULUM, g=g), sensors=sensors, truth="linear", sample_rate=SLOW_HZ, duration=30.0, seed=1
        ).run
        for g in (STANDARD_PENDULUM.g, 1.2 * STANDARD_PENDULUM.g)
    )
    return replace(before, phi=np.where(np.arange(len(before.phi)) < CHANGE, before.phi, after.phi))


@pytest.mark.slow
@pytest.mark.parametrize("law", ["stationary", "pseudovelocity"])
def test_float32_equals_its_twin_under_the_alarm(law: str, matrix: dict[str, Native], changed: Run) -> None:
    config = strong_config(rig_of(FINE_BITS, law=law), SLOW_HZ)
    lanes = [replace(config.estimator, forgetting_s=tau, feedback_hz=f) for tau in (0.0, 1.0) for f in (0.0, 10.0)]
    compared = assert_lanes_equal(matrix.values(), config, changed.phi[:2000], changed.y[:2000], lanes)
    assert compared[0].counters["misfits"] > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "identifier",
    [{}, {"forgetting_s": 1.0, "outlier_gate": 0.0}, {"feedback_hz": 0.0, "divider": 3}, {"law": "pseudovelocity"}],
)
def test_fixed_point_equals_its_twin_under_the_alarm(
    identifier: dict[str, Any], matrix: dict[str, Native], changed: Run
) -> None:
    rig = rig_of(FINE_BITS, **identifier)
    phi, y = (counts[:2000] for counts in counts_of(rig, changed))
    (lane,) = assert_lanes_equal(matrix.values(), strong_config_q31(rig, SLOW_HZ), phi, y)
    assert lane.counters["misfits"] > 0


@both_cores
def test_change_that_sums_cannot_follow_raises_the_alarm(core: str, native: Native, changed: Run) -> None:
    reason = reasons_of(native, rig_of(FINE_BITS, core), changed)
    assert not (reason[:CHANGE] == Reason.MISFIT).any()
    assert np.isin(reason[CHANGE + 500 :], DOUBTED).all()
    assert (reason[-1000:] == Reason.MISFIT).any()


@both_cores
def test_alarm_of_a_followed_change_ends_with_its_block(core: str, native: Native, changed: Run) -> None:
    rig, case = rig_of(FINE_BITS, core, forgetting_s=0.5), CASES["strong", core]
    config = case.settings(rig, SLOW_HZ)
    identifier = native.identifier(config)
    reason = identifier.run(*case.samples(rig, changed), sums=False).reason
    assert (reason == Reason.MISFIT).any()
    assert (reason[-1000:] == Reason.UPDATED).all()
    w = case.p_of(config, identifier.assess()["p"][:3])[0]
    assert w == pytest.approx(1.2 * STANDARD_PENDULUM.linear[0], rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("bits", "alarm"), [(22, False), (20, False), (18, False), (16, True), (14, True), (12, True)])
def test_too_coarse_encoder_is_reported(bits: int, alarm: bool, seed: int, native: Native) -> None:
    # 18 bits: w 0.3 % off at a standard error of 0.26 %; 16 bits: 6.2 % at 1.0 %
    run = simulate(sensors=standard_sensors(bits), truth="linear", duration=40.0, seed=seed).run
    for core in ("f32", "q31"):
        reasons = reasons_of(native, rig_of(bits, core), run)[8_500:]  # the second block is the first that is judged
        assert np.isin(reasons, DOUBTED).all() if alarm else not (reasons == Reason.MISFIT).any()


def test_standard_rig_raises_no_alarm_from_any_start(native: Native, standard_20_bits: Simulation) -> None:
    rig = rig_of(20)
    counts = [c[:14_000] for c in counts_of(rig, standard_20_bits.run)]
    for seed in range(20):
        core = native.identifier(strong_config_q31(rig, 1000.0, standard_start(seed)))
        assert not np.isin(core.run(*counts, sums=False).reason, DOUBTED).any(), seed
    core = native.identifier(strong_config_q31(rig_of(20, law="pseudovelocity"), 1000.0))
    assert not np.isin(core.run(*counts, sums=False).reason, DOUBTED).any()


@both_cores
def test_other_drives_are_no_misfit(core: str, native: Native) -> None:
    # the same motion and drive, smaller and larger by turns: residuals go with them, and their part stays
    sensors = replace(standard_sensors(24), random_offset=False)
    run = simulate(sensors=sensors, truth="linear", sample_rate=SLOW_HZ, duration=14.0, seed=1).run
    phi = np.concatenate([run.phi, 0.3 * run.phi, run.phi])
    whole = replace(run, t=np.arange(len(phi)) / SLOW_HZ, phi=phi, y=np.concatenate([run.y, run.y, run.y]))
    reason = reasons_of(native, rig_of(24, core), whole)
    settled = np.concatenate([np.arange(563, 1750), np.arange(3250, 3500), np.arange(5000, 5250)])
    assert not (reason[settled] == Reason.MISFIT).any()


def test_gradient_of_a_row_is_that_of_its_innovation(changed: Run) -> None:
    rig = rig_of(FINE_BITS)
    config = strong_config_q31(rig, SLOW_HZ)
    rows, row_reason = StrongTwinQ31(config).rows(*counts_of(rig, changed))
    taken = rows[row_reason == Reason.UPDATED][::50].T

    def innovation(factors: tuple[float, float, float]) -> tuple[Any, Any]:
        start = strong_config_q31(rig, SLOW_HZ, np.multiply(nominal_start(rig), factors)).estimator
        e, gradient, fits = KapitzaEstimatorQ31([start] * taken.shape[1], config.row).innovation(taken)
        assert fits.all()
        return np.asarray(e, np.float64), np.asarray(gradient, np.float64)

    gradient = innovation((1, 1, 1))[1]
    estimator = config.estimator
    units = 2.0 ** -np.array([estimator.p_bits[0], *np.add(estimator.p_bits[1:], config.row.finer)])
    for a in range(3):
        more, less = (innovation(tuple(1 + change * (i == a) for i in range(3)))[0] for change in (0.001, -0.001))  # type: ignore[arg-type]
        slope = (less - more) / (0.002 * estimator.start[a])
        # of third order in 0.001, and an innovation rounded to a few units
        rounding = 5 / (0.002 * estimator.start[a])
        assert np.abs(gradient[a] * units[a] - slope).max() < 1e-4 * np.abs(slope).max() + rounding
