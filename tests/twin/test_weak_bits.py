"""Bit equality of the weak form in C and its numpy twin, after every tick: builds, laws, sizes, hostile samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.weak import design
from pvid.design.weak_sizing import Sizes
from pvid.models.kapitza.physical import linear
from pvid.run.compare import first_difference
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig, TrustConfig, WeakConfig
from pvid.settings.record import Record
from pvid.sim.pendulum import STANDARD_PENDULUM, Simulation, simulate, standard_sensors, standard_start
from pvid.twin import fnv
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


def assert_lanes_equal(
    natives: list[Native], config: WeakConfig, lanes: list[EstimatorConfig], phi: Samples, y: Samples
) -> list[Record]:
    """Runs every build and one pass of the twin; returns the records of the last build."""
    twin = WeakTwin(config, lanes)
    expected = twin.run(phi, y)
    records = []
    for lane, one in enumerate(lanes):
        own = expected.lane(lane)
        hashes = fnv.running_hashes(own)
        for native in natives:
            core = native.identifier(replace(config, estimator=one))
            record = core.run(phi, y)
            assert first_difference(record, own) is None, native.build
            assert np.array_equal(record.hash, hashes), native.build
            assert core.counters == {name: int(of[lane]) for name, of in twin.estimator.counters.items()}
            assert core.assess().tobytes() == twin.estimator.assess()[lane].tobytes()
            assert core.estimate.tobytes() == twin.trust.estimate[lane].tobytes()
            assert (core.published is not None) == twin.trust.published[lane]
            assert np.isfinite(record.p).all() and np.isfinite(record.sums).all()
        records.append(record)
    return records


def test_twelve_lanes_equal_the_twin_in_every_build(matrix: dict[str, Native], standard_14_bits: Simulation) -> None:
    run = standard_14_bits.run
    lanes = [replace(estimator(seed), forgetting_s=tau) for seed in range(4) for tau in (0.0, 5.0, 40.0)]
    records = assert_lanes_equal([matrix[name] for name in BUILDS], configuration(), lanes, run.phi, run.y)
    for record in records:
        # a window every 0.855 s; this configuration takes the pivot's sensor for exact
        assert np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)).sum() >= 19
        assert record.p[-1, :3] == pytest.approx(standard_14_bits.p, rel=0.005)


@pytest.mark.parametrize(
    ("full_angle", "friction"), [(True, False), (True, True), (False, True)], ids=["angle", "both", "friction"]
)
def test_the_correction_equals_the_twin_in_every_build(
    matrix: dict[str, Native], full_angle: bool, friction: bool
) -> None:
    pendulum = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=1e-4)
    run = simulate(pendulum, sensors=standard_sensors(14), truth="full", duration=20.0, seed=1).run
    lanes = [with_friction(estimator(seed)) if friction else estimator(seed) for seed in range(3)]
    config = replace(configuration(), full_angle=full_angle, friction=friction, angle_limit=0.12)
    config = replace(config, trust=TrustConfig(misfit_max=6.0))
    records = assert_lanes_equal([matrix[name] for name in BUILDS], config, lanes, run.phi, run.y)
    for record in records:
        assert np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)).sum() >= 14
        assert record.published[-1, :3] == pytest.approx(STANDARD_PENDULUM.linear, rel=0.02)


def test_the_correction_of_hostile_samples_equals_the_twin(native: Native, standard_14_bits: Simulation) -> None:
    phi, y = hostile(standard_14_bits)
    config = replace(configuration(), full_angle=True, friction=True)
    assert_lanes_equal([native], config, [with_friction(estimator(seed)) for seed in range(3)], phi, y)


def test_a_zeroed_encoder_equals_the_twin_in_every_build(
    matrix: dict[str, Native], standard_14_bits: Simulation
) -> None:
    run = standard_14_bits.run
    lanes = [estimator(seed, zero_unknown=False) for seed in range(3)]
    config = replace(configuration(zero_unknown=False), iterations=2)
    assert_lanes_equal([matrix[name] for name in BUILDS], config, lanes, run.phi[:8000], run.y[:8000])


@pytest.mark.parametrize(
    ("law", "feedback_hz", "divider"),
    [(Law.PSEUDOVELOCITY, 0.0, 1), (Law.STATIONARY, 0.5, 1), (Law.STATIONARY, 0.0, 3)],
)
def test_laws_and_divider_equal_the_twin(
    native: Native, standard_14_bits: Simulation, law: Law, feedback_hz: float, divider: int
) -> None:
    run = standard_14_bits.run
    lanes = [replace(estimator(seed), law=law, feedback_hz=feedback_hz, divider=divider) for seed in range(3)]
    assert_lanes_equal([native], configuration(), lanes, run.phi[:10000], run.y[:10000])


@pytest.mark.parametrize(
    "sizes",
    [
        Sizes(decimation=1, taps=31, functions=4, window_s=0.25),
        Sizes(decimation=2, taps=31, functions=4, window_s=0.5),
        Sizes(decimation=3, taps=21, functions=7, window_s=0.6),
        Sizes(decimation=5, taps=61, functions=16, window_s=0.75),
        Sizes(decimation=32, taps=81, functions=5, window_s=2.0),
        Sizes(decimation=64, taps=401, functions=16, window_s=1.3),
    ],
    ids=lambda sizes: f"D{sizes.decimation}-K{sizes.functions}",
)
def test_every_size_equals_the_twin(native: Native, standard_14_bits: Simulation, sizes: Sizes) -> None:
    run = standard_14_bits.run
    records = assert_lanes_equal([native], configuration(sizes=sizes), [estimator(0)], run.phi[:8000], run.y[:8000])
    assert (records[0].reason != Reason.WARMING_UP).any()


def test_many_stages_a_tick_equal_the_twin(native: Native) -> None:
    """200 Hz, no decimation, both corrections: several stages at every sample."""
    pendulum = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=1e-4)
    run = simulate(pendulum, sensors=standard_sensors(14), sample_rate=200.0, truth="full", duration=20.0, seed=1).run
    tables = design(L1, 200.0, NOMINAL, Sizes(window_s=0.3, decimation=1, taps=15, functions=12)).f32
    config = WeakConfig(200.0, L1, tables, with_friction(estimator(0)), full_angle=True, friction=True)
    assert tables.window == 61
    assert WeakTwin(config).stages_per_tick >= 8
    record = assert_lanes_equal([native], config, [config.estimator], run.phi, run.y)[0]
    assert (record.reason == Reason.HELD_UNCERTAIN).any()  # windows are worked off, short as they are


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
    records = assert_lanes_equal([native], config, lanes, phi, y)
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
    assert_lanes_equal([native], configuration(), [absurd], run.phi[:8000], run.y[:8000])


def test_without_motion_or_drive_p_does_not_move(native: Native, standard_14_bits: Simulation) -> None:
    y = standard_14_bits.run.y[:8000]
    config = replace(configuration(), drive_min=0.4)
    still = np.zeros(8000)
    for phi, drive in ((still, still), (standard_14_bits.run.phi[:8000], still), (still, y)):
        record = assert_lanes_equal([native], config, [estimator(0)], phi, drive)[0]
        assert np.array_equal(record.p[-1, :3], estimator(0).start[:3])
        assert (record.reason == Reason.HELD_NOT_EXCITED).any()


def test_a_pause_of_the_drive_freezes_p_and_the_sums(native: Native, standard_14_bits: Simulation) -> None:
    phi, y = standard_14_bits.run.phi, standard_14_bits.run.y.copy()
    y[8000:16000] = y[8000]
    config = replace(configuration(), drive_min=0.4)
    record = assert_lanes_equal([native], config, [estimator(0)], phi, y)[0]
    # the last window that saw the drive is complete 1.79 s after it stops, and worked off 0.3 s later
    paused = slice(8000 + 2100, 16000)
    assert (record.p[paused] == record.p[paused.start]).all()
    assert (record.sums[paused] == record.sums[paused.start]).all()
    assert (record.p[-1] != record.p[paused.start]).any()


def test_a_run_in_two_pieces_has_the_bits_of_one(native: Native, standard_14_bits: Simulation) -> None:
    run = standard_14_bits.run
    whole = native.identifier(configuration())
    whole.run(run.phi[:9000], run.y[:9000])
    pieces = native.identifier(configuration())
    for part in (slice(0, 1), slice(1, 2345), slice(2345, 2346), slice(2346, 9000)):
        pieces.run(run.phi[part], run.y[part])
    assert pieces.running_hash == whole.running_hash


def test_a_gap_keeps_the_sums_and_starts_the_windows_again(native: Native, standard_14_bits: Simulation) -> None:
    run = standard_14_bits.run
    config = configuration()
    reported, seen = native.identifier(config), native.identifier(config)
    for core in (reported, seen):
        core.run(run.phi[:8000], run.y[:8000])
    reported.gap()
    told_record = reported.run(run.phi[7000:9000], run.y[7000:9000])
    broken = np.concatenate([[np.nan], run.phi[7000:9000]])
    seen_record = seen.run(broken, np.concatenate([[0.0], run.y[7000:9000]]))
    assert np.array_equal(told_record.p, seen_record.p[1:])
    assert np.array_equal(told_record.sums, seen_record.sums[1:])
    assert told_record.sums[0, -1] > 0
    assert told_record.reason[0] in (Reason.WARMING_UP, Reason.UPDATED)


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
