"""The strong form's verdict on itself: its bits, when it speaks and when it does not, and who hears of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from strong_lanes import strong_lanes

from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.identify import identify
from pvid.settings.enums import Reason
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import STANDARD_PENDULUM, Sensors, simulate, standard_sensors

RATE_HZ = 1000.0
CHANGE = 9_000  # tick


def rig_of(lsb: float, **identifier: Any) -> RigFile:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", **identifier)
    sensor = replace(rig.sensor, phi_lsb=lsb, y_lsb=rig.sensor.y_lsb if lsb > 0.0 else 0.0)
    return replace(rig, identifier=settings, sensor=sensor)


@pytest.fixture(scope="module")
def changed() -> Run:
    """30 s with exact sensors; after 9 s w is larger by 20 %."""
    before, after = (
        simulate(replace(STANDARD_PENDULUM, g=g), sensors=Sensors(), truth="linear", duration=30.0, seed=1).run
        for g in (STANDARD_PENDULUM.g, 1.2 * STANDARD_PENDULUM.g)
    )
    return replace(before, phi=np.where(np.arange(len(before.phi)) < CHANGE, before.phi, after.phi))


@pytest.mark.parametrize("law", ["stationary", "pseudovelocity"])
def test_the_core_equals_its_twin_under_the_alarm(law: str, matrix: dict[str, Native], changed: Run) -> None:
    phi, y = changed.phi[:14_000], changed.y[:14_000]
    config = strong_config(rig_of(0.0, stride=8, law=law), RATE_HZ)
    lanes = [replace(config.estimator, forgetting_s=tau, feedback_hz=f) for tau in (0.0, 1.0) for f in (0.0, 10.0)]
    counters, _ = strong_lanes(config, lanes, phi, y, matrix)[0]
    assert counters["misfits"] > 0


def test_change_that_sums_cannot_follow_raises_the_alarm(native: Native, changed: Run) -> None:
    core = native.identifier(strong_config(rig_of(0.0, stride=8), RATE_HZ))
    reason = core.run(changed.phi, changed.y, sums=False).reason
    assert not (reason[:CHANGE] == Reason.MISFIT).any()
    assert np.isin(reason[CHANGE + 4_000 :], (Reason.MISFIT, Reason.REJECTED_OUTLIER)).all()
    assert (reason[-8_000:] == Reason.MISFIT).any()


def test_alarm_of_a_followed_change_ends_with_its_block(native: Native, changed: Run) -> None:
    core = native.identifier(strong_config(rig_of(0.0, stride=8, forgetting_s=0.5), RATE_HZ))
    reason = core.run(changed.phi, changed.y, sums=False).reason
    assert (reason == Reason.MISFIT).any()
    assert (reason[-8_000:] == Reason.UPDATED).all()
    assert core.assess()["p"][0] == pytest.approx(1.2 * STANDARD_PENDULUM.linear[0], rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("bits", "alarm"), [(22, False), (20, False), (18, False), (16, True), (14, True), (12, True)])
def test_too_coarse_encoder_is_reported(bits: int, alarm: bool, seed: int, native: Native) -> None:
    # 18 bits: w 0.3 % off at a standard error of 0.26 %; 16 bits: 6.2 % at 1.0 %
    run = simulate(sensors=standard_sensors(bits), truth="linear", duration=40.0, seed=seed).run
    core = native.identifier(strong_config(rig_of(2 * np.pi / 2**bits), RATE_HZ))
    reasons = core.run(run.phi, run.y, sums=False).reason[8_500:]  # the second block is the first that is judged
    misfits = np.isin(reasons, (Reason.MISFIT, Reason.REJECTED_OUTLIER))
    assert misfits.all() if alarm else not (reasons == Reason.MISFIT).any()


def test_other_drives_are_no_misfit(native: Native) -> None:
    # the same motion and drive, smaller and larger by turns: residuals go with them, and their part stays
    run = simulate(sensors=Sensors(), truth="linear", duration=14.0, seed=1).run
    phi = np.concatenate([run.phi, 0.3 * run.phi, run.phi])
    core = native.identifier(strong_config(rig_of(0.0, stride=8), RATE_HZ))
    record = core.run(phi, np.concatenate([run.y, run.y, run.y]), sums=False)
    settled = np.concatenate([np.arange(4_500, 14_000), np.arange(26_000, 28_000), np.arange(40_000, 42_000)])
    assert not (record.reason[settled] == Reason.MISFIT).any()


def test_identify_prints_the_finding(native: Native) -> None:
    for bits, doubted in ((20, False), (14, True)):
        run = simulate(sensors=standard_sensors(bits), truth="linear", duration=20.0, seed=1).run
        answer = identify(run, rig_of(2 * np.pi / 2**bits), native)
        assert answer.identified
        assert answer.alarm is doubted
        assert (answer.warning is not None) == doubted
        assert (answer.status == Reason.MISFIT.text) == doubted
