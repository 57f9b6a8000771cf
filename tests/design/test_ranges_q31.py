"""Full scales of the fixed-point core: the file's, the defaults, or what the run needs; and the share beyond them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.campaign.judge import identify_rig
from bench.campaign.population import shipped
from bench.campaign.truth import simulate_rig
from pvid.core.native import Native
from pvid.rig.file import RigFile, Sensor
from pvid.rig.run import Run
from pvid.run.identify import identify
from pvid.run.survey import fitted
from pvid.settings.q31 import WeakConfigQ31
from pvid.setup.q31 import config_for_run
from pvid.setup.ranges_q31 import DEFAULT_PHI_RANGE, beyond_ranges, pivot_acceleration, with_ranges_of
from pvid.sim.pendulum import Pendulum, Tone, simulate, standard_sensors

STANDARD = RigFile.standard()
RIG = replace(STANDARD, identifier=replace(STANDARD.identifier, core="q31"))


def far_run(offset: float = 0.0) -> Run:
    """A slow, wide drive: 45 mm to a side, where a tenth of l1 is 30 mm."""
    return simulate(
        Pendulum(l1=0.3, l2=0.12, rho2=0.08, g=9.5),
        drive=(Tone(0.037, 1.0), Tone(0.012, 1.7, 1.0)),
        sensors=standard_sensors(14),
        sample_rate=500.0,
        duration=15.0,
        release=(0.03, 0.07),
        truth="linear",
        seed=1,
    ).run


def test_without_a_need_the_ranges_are_the_defaults() -> None:
    run = simulate(duration=5.0).run
    sensor = with_ranges_of(RIG, run).sensor
    assert sensor.phi_range == DEFAULT_PHI_RANGE
    assert sensor.y_range == pytest.approx(0.03)


def test_the_acceleration_range_follows_the_run_both_ways() -> None:
    run = simulate(duration=20.0).run
    largest = float(np.abs(pivot_acceleration(run)).max())
    sensor = with_ranges_of(RIG, run).sensor
    assert 1.8 * largest < sensor.acceleration_range < 2.4 * largest < 4 * 9.8
    y = run.y.copy()
    y[2000] += 1.0  # a fault: the default stays
    assert with_ranges_of(RIG, replace(run, y=y)).sensor.acceleration_range == pytest.approx(4 * 9.8)


def test_a_run_that_goes_further_sets_them() -> None:
    run = far_run()
    sensor = with_ranges_of(RIG, run).sensor
    assert 1.2 * np.abs(run.y).max() < sensor.y_range < 1.4 * np.abs(run.y).max()
    wide = with_ranges_of(RIG, replace(run, phi=20 * run.phi)).sensor
    assert wide.phi_range > 20 * np.abs(run.phi).max()
    fast = with_ranges_of(RIG, replace(run, y=20 * run.y)).sensor
    assert fast.acceleration_range > 20 * 0.037 * (2 * np.pi) ** 2


def test_setting_of_the_file_is_kept() -> None:
    sensor = Sensor(phi_range=0.2, y_range=0.01, acceleration_range=7.0)
    kept = with_ranges_of(replace(RIG, sensor=sensor), far_run()).sensor
    assert (kept.phi_range, kept.y_range, kept.acceleration_range) == (0.2, 0.01, 7.0)


def test_a_fault_of_the_sensor_widens_no_range() -> None:
    run = far_run()
    y = run.y.copy()
    y[100], y[200], y[300] = 5.0, np.nan, -np.inf
    usual, faulty = (with_ranges_of(RIG, one).sensor for one in (run, replace(run, y=y)))
    assert faulty.y_range < 3 * usual.y_range


def test_a_run_beyond_a_tenth_of_l1_is_identified(native: Native) -> None:
    run = far_run()
    for raised in (0.0, 0.4):  # y counted from the floor: the middle of its travel is the offset
        result = identify(replace(run, y=run.y + raised), RIG, native)
        assert result.identified and result.warning is None
        assert result.beyond is not None and result.beyond.share == 0
        # some 0.3 % of noise in 15 s
        assert result.value["g"] == pytest.approx(9.5, rel=0.02)


def test_an_answer_in_spite_of_samples_beyond_range_has_a_warning(native: Native) -> None:
    run = simulate(sensors=standard_sensors(14), duration=20.0, seed=1).run
    y = run.y.copy()
    y[:400] += 0.5  # 2 % of the run, before the pivot is where it stays
    given = replace(RIG, sensor=replace(RIG.sensor, y_range=0.03))
    result = identify(replace(run, y=y), given, native)
    assert result.identified
    assert result.warning is not None
    assert result.warning.endswith("2 % of the samples are beyond y_range = 0.03 m: those samples were left out")
    assert identify(replace(run, y=y), RIG, native).identified  # the jump itself widens no range of acceleration


def test_an_angle_turned_by_pi_is_counted_from_there(native: Native) -> None:
    run = simulate(sensors=standard_sensors(14), duration=15.0, seed=1).run
    turned = replace(run, phi=run.phi + np.pi)
    known = replace(RIG, sensor=replace(RIG.sensor, phi_zero=3.14))
    for rig in (RIG, known):
        result = identify(turned, rig, native)
        assert result.identified and result.value["c"] == pytest.approx(np.pi, abs=1e-3)
    config = config_for_run(known, turned)
    assert config.phi_offset == round(3.14 / known.sensor.phi_lsb)


def test_beyond_range_counts_each_sensor_and_core_refusals() -> None:
    phi, y = np.array([0, 11, 0, 0, -11]), np.array([0, 0, 21, 0, -21])
    beyond = beyond_ranges(phi, y, 10, 20, rejected=4)
    assert (beyond.phi, beyond.y, beyond.acceleration, beyond.samples) == (2, 2, 1, 5)
    assert beyond.share == 0.4
    words = beyond.words(Sensor(phi_range=0.5, y_range=0.03, acceleration_range=40.0))
    assert words is not None and words.startswith("40 % of the samples are beyond phi_range = 0.5 rad and 40 % of")
    assert beyond_ranges(phi, y, 20, 40, rejected=0).words(Sensor()) is None


def test_the_pivots_acceleration_of_a_sine() -> None:
    t = np.arange(5000) / 1000.0
    run = Run(t=t, phi=0 * t, y=0.01 * np.sin(2 * np.pi * 2 * t), sample_rate=1000.0)
    inner = pivot_acceleration(run)[100:-100]
    assert np.abs(inner).max() == pytest.approx(0.01 * (4 * np.pi) ** 2, rel=0.01)
    assert len(pivot_acceleration(replace(run, t=t[:5], phi=t[:5], y=t[:5]))) == 0


def test_unfilled_windows_name_the_rejected_samples(native: Native) -> None:
    """A sample that is no number twice a second: the run ends while the windows warm up, and that is not the reason."""
    run = simulate(sensors=standard_sensors(14), duration=6.0, seed=1).run
    phi = run.phi.copy()
    phi[300::500] = np.nan
    result = identify(replace(run, phi=phi), STANDARD, native, start=[30.0, 9.0, 5.5])
    assert not result.identified
    assert result.status == "rejected not finite"


def test_a_coarse_encoder_at_a_low_rate_is_taken_in(native: Native) -> None:
    """81 counts and the shortest filters: the smoothing weights had 35 bits after the point, and the core takes 31."""
    rig = simulate_rig(native, shipped(), 2, 154)
    record, _ = identify_rig(native, rig, "q31")
    assert "refused" not in str(record["reason"])
    q31 = replace(rig.file, identifier=replace(rig.file.identifier, core="q31"))
    config = config_for_run(fitted(q31, rig.run), rig.run)
    assert isinstance(config, WeakConfigQ31) and config.design.smooth_bits == 31
