"""Full scales of the fixed-point core: the file's, the defaults, or what the run needs; and the share beyond them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvid.rig.file import RigFile, Sensor
from pvid.rig.run import Run
from pvid.setup.ranges_q31 import DEFAULT_PHI_RANGE, beyond_ranges, pivot_acceleration, with_ranges_of
from pvid.sim.pendulum import Pendulum, Tone, simulate, standard_sensors

STANDARD = RigFile.standard()
RIG = replace(STANDARD, identifier=replace(STANDARD.identifier, core="q31", form="strong"))


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


def test_the_acceleration_range_is_the_default_or_what_the_run_needs() -> None:
    run = simulate(duration=20.0).run
    assert with_ranges_of(RIG, run).sensor.acceleration_range == pytest.approx(4 * 9.8)
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


def test_beyond_range_counts_each_sensor() -> None:
    phi, y = np.array([0, 11, 0, 0, -11]), np.array([0, 0, 21, 0, -21])
    beyond = beyond_ranges(phi, y, 10, 20)
    assert (beyond.phi, beyond.y, beyond.samples) == (2, 2, 5)
    assert beyond.share == 0.4
    words = beyond.words(Sensor(phi_range=0.5, y_range=0.03, acceleration_range=40.0))
    assert words is not None and words.startswith("40 % of the samples are beyond phi_range = 0.5 rad and 40 % of")
    assert beyond_ranges(phi, y, 20, 40).words(Sensor()) is None


def test_the_pivots_acceleration_of_a_sine() -> None:
    t = np.arange(5000) / 1000.0
    run = Run(t=t, phi=0 * t, y=0.01 * np.sin(2 * np.pi * 2 * t), sample_rate=1000.0)
    inner = pivot_acceleration(run)[100:-100]
    assert np.abs(inner).max() == pytest.approx(0.01 * (4 * np.pi) ** 2, rel=0.01)
    assert len(pivot_acceleration(replace(run, t=t[:5], phi=t[:5], y=t[:5]))) == 0
