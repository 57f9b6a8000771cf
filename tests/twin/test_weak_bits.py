"""Bit equality of the weak form in C and its numpy twin, after every tick: builds, laws, sizes, hostile samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from lanes import assert_lanes_equal

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.weak import design
from pvid.design.weak_sizing import Sizes
from pvid.models.kapitza.physical import linear
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig, WeakConfig
from pvid.settings.record import Record
from pvid.sim.pendulum import Simulation, simulate, standard_sensors, standard_start
from pvid.twin.weak import WeakTwin

BUILDS = ("gcc-O0", "gcc-O2", "gcc-O3", "clang-O0", "clang-O2", "clang-O3")
L1 = 0.3
NOMINAL = linear(9.8, 0.1, 0.1, L1)
Samples = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def standard_14_bits() -> Simulation:
    """The standard rig, linear truth, 14-bit encoder, 20 s at 1 kHz."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=20.0, seed=1)


def estimator(seed: int, zero_unknown: bool = True) -> EstimatorConfig:
    """A start within 50 % of the truth."""
    p = standard_start(seed)
    lower, upper, sd = p / 20, p * 20, p / 2
    if zero_unknown:
        p, lower, upper, sd = (np.append(a, c) for a, c in ((p, 0.0), (lower, -1.0), (upper, 1.0), (sd, 0.5)))
    start, start_sd, low, high = (a.astype(np.float32) for a in (p, sd, lower, upper))
    return EstimatorConfig(start=start, start_sd=start_sd, lower=low, upper=high, row_sd=8e-5, kappa_min=5e-6)


def with_friction(config: EstimatorConfig) -> EstimatorConfig:
    """Two frictions more, of a thousandth."""

    def longer(values: npt.NDArray[np.float32], value: float) -> npt.NDArray[np.float32]:
        return np.append(values, [value, value]).astype(np.float32)

    return replace(
        config,
        start=longer(config.start, 0.0),
        start_sd=longer(config.start_sd, 1e-3),
        lower=longer(config.lower, -0.1),
        upper=longer(config.upper, 0.1),
    )


def configuration(zero_unknown: bool = True, sizes: Sizes | None = None) -> WeakConfig:
    """The base design, or one of other sizes."""
    tables = design(L1, 1000.0, NOMINAL, sizes).f32
    return WeakConfig(1000.0, L1, tables, estimator(0, zero_unknown), zero_unknown=zero_unknown)


def records_of(
    natives: list[Native], config: WeakConfig, lanes: list[EstimatorConfig], phi: Samples, y: Samples
) -> list[Record]:
    """Compares every build with the twin, the running hash at every tick; the records of the last build."""
    return [lane.record for lane in assert_lanes_equal(natives, config, phi, y, lanes, len(phi))]


def test_the_correction_of_hostile_samples_equals_the_twin(native: Native, standard_14_bits: Simulation) -> None:
    phi, y = hostile(standard_14_bits)
    config = replace(configuration(), full_angle=True, friction=True)
    records_of([native], config, [with_friction(estimator(seed)) for seed in range(3)], phi, y)


@pytest.mark.parametrize(
    ("law", "feedback_hz", "divider"),
    [(Law.PSEUDOVELOCITY, 0.0, 1), (Law.STATIONARY, 0.5, 1), (Law.STATIONARY, 0.0, 3)],
)
def test_laws_and_divider_equal_the_twin(
    native: Native, standard_14_bits: Simulation, law: Law, feedback_hz: float, divider: int
) -> None:
    run = standard_14_bits.run
    lanes = [replace(estimator(seed), law=law, feedback_hz=feedback_hz, divider=divider) for seed in range(3)]
    records_of([native], configuration(), lanes, run.phi[:10000], run.y[:10000])


def hostile(simulation: Simulation) -> tuple[Samples, Samples]:
    """NaN before, inside and right after windows, infinity, overflowing steps, a dead encoder, a still pivot."""
    rng = np.random.default_rng(7)
    phi = simulation.run.phi[:16000].copy()
    y = simulation.run.y[:16000].copy()
    phi[[100, 3003, 5000, 5100]] = np.nan
    phi[5020:5040:3] = np.nan
    y[3000] = np.inf
    phi[9000:9100] = 1e30 * rng.standard_normal(100)
    y[12000:12010] = 3e38
    phi[13000:] = 0.0
    y[14000:] = 0.0
    return phi, y


@pytest.mark.parametrize("kappa_min", [0.0, 5e-6])
@pytest.mark.parametrize("drive_min", [0.0, 0.4])
def test_hostile_samples_equal_the_twin(
    native: Native, standard_14_bits: Simulation, kappa_min: float, drive_min: float
) -> None:
    phi, y = hostile(standard_14_bits)
    config = replace(configuration(), drive_min=drive_min)
    lanes = [replace(estimator(seed), kappa_min=kappa_min) for seed in range(3)]
    records = records_of([native], config, lanes, phi, y)
    rejected = np.flatnonzero(records[0].reason == Reason.REJECTED_NOT_FINITE)
    assert set(np.flatnonzero(~(np.isfinite(phi) & np.isfinite(y)))) <= set(rejected)


def test_absurd_parameters_stay_finite_and_equal_the_twin(native: Native, standard_14_bits: Simulation) -> None:
    run = standard_14_bits.run
    absurd = replace(
        estimator(0),
        start=np.array([1e20, 1e20, 1e20, 0], np.float32),
        start_sd=np.array([1e10, 1e10, 1e10, 0.5], np.float32),
        lower=np.array([1e-30, 1e-30, 1e-30, -1], np.float32),
        upper=np.array([1e30, 1e30, 1e30, 1], np.float32),
        kappa_min=0.0,
    )
    records_of([native], configuration(), [absurd], run.phi[:8000], run.y[:8000])


def test_without_motion_or_drive_p_does_not_move(native: Native, standard_14_bits: Simulation) -> None:
    y = standard_14_bits.run.y[:8000]
    config = replace(configuration(), drive_min=0.4)
    still = np.zeros(8000)
    for phi, drive in ((still, still), (standard_14_bits.run.phi[:8000], still), (still, y)):
        record = records_of([native], config, [estimator(0)], phi, drive)[0]
        assert np.array_equal(record.p[-1, :3], estimator(0).start[:3])
        assert (record.reason == Reason.HELD_NOT_EXCITED).any()


def test_lanes_with_different_schedules_are_refused() -> None:
    lanes = [estimator(0), replace(estimator(1), divider=2)]
    with pytest.raises(PvidError, match="share law"):
        WeakTwin(configuration(), lanes)


def test_a_window_too_short_for_its_work_is_refused(native: Native) -> None:
    # a hop of 4 ticks: 8 stages for each function, 17 for each step and some 30 others, of which a tick takes 32
    config = configuration(sizes=Sizes(decimation=1, taps=31, functions=4, window_s=0.008))
    native.identifier(replace(config, iterations=2))
    with pytest.raises(PvidError, match="bad iterations"):
        native.identifier(replace(config, iterations=6))
