"""The fixed-point weak form in C and its numpy twin, integer by integer: builds, laws, sizes, hostile counts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.run.compare import first_difference
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, WeakConfigQ31
from pvid.settings.record import Record
from pvid.setup.q31 import counts_of, p_of, weak_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start
from pvid.twin import fnv
from pvid.twin.weak_q31 import WeakTwinQ31

BUILDS = ("gcc-O0", "gcc-O2", "gcc-O3", "clang-O0", "clang-O2", "clang-O3")
RIG = RigFile.standard()
Counts = npt.NDArray[np.int64]
HASHED_TICKS = 3000  # past the work on the first two windows


@pytest.fixture(scope="module")
def counts() -> tuple[Counts, Counts]:
    """The standard rig's counts, linear truth, 14 bits, 40 s at 1 kHz."""
    run = simulate(sensors=standard_sensors(14), truth="linear", seed=1).run
    phi = np.rint(run.phi / RIG.sensor.phi_lsb).astype(np.int64)
    return phi, np.rint(run.y / RIG.sensor.y_lsb).astype(np.int64)


@cache
def configuration(seed: int = 0, zero_unknown: bool = True, **identifier: Any) -> WeakConfigQ31:
    """The standard rig's settings, a start within 50 % of the truth."""
    rig = replace(RIG, identifier=replace(RIG.identifier, zero=zero_unknown, **identifier))
    return weak_config_q31(rig, 1000.0, standard_start(seed))


def first_ticks(record: Record, ticks: int) -> Record:
    """The beginning of a run."""
    return Record(record.p[:ticks], record.sums[:ticks], record.reason[:ticks], record.exponent[:ticks])


def assert_lanes_equal(
    natives: list[Native],
    config: WeakConfigQ31,
    lanes: list[EstimatorConfigQ31],
    phi: Counts,
    y: Counts,
    *,
    hashed_ticks: int = HASHED_TICKS,
) -> WeakTwinQ31:
    """Runs every build and one pass of the twin: every integer after every tick, and the running hash in every lane
    for its first ticks (it is a function of these integers, and slow in Python)."""
    twin = WeakTwinQ31(config, lanes)
    expected = twin.run(phi, y)
    assessed = twin.estimator.assess()
    for lane, one in enumerate(lanes):
        own = expected.lane(lane)
        hashes = fnv.running_hashes(first_ticks(own, hashed_ticks))
        for native in natives:
            core = native.identifier(replace(config, estimator=one))
            record = core.run(phi, y)
            assert first_difference(record, own) is None, native.build
            assert np.array_equal(record.hash[:hashed_ticks], hashes)
            assert core.running_hash == record.hash[-1]
            assert core.estimate.tobytes() == twin.trust.estimate[lane].tobytes()
            assert core.counters == {name: int(of[lane]) for name, of in twin.estimator.counters.items()}
            assert core.assess().tobytes() == assessed[lane].tobytes()
            assert (record.p >= np.array(one.lower)).all() and (record.p <= np.array(one.upper)).all()
    return twin


def test_twenty_starts_equal_the_twin_in_every_build(matrix: dict[str, Native], counts: tuple[Counts, Counts]) -> None:
    lanes = [configuration(seed).estimator for seed in range(20)]
    config = configuration()
    twin = assert_lanes_equal([matrix[name] for name in BUILDS], config, lanes, *counts)
    assert_lanes_equal([matrix["gcc-O2"]], config, lanes[:1], *counts, hashed_ticks=len(counts[0]))
    # from every start: 1.5 times what the standard errors of this run promise
    assert p_of(config, twin.estimator.p.T)[:, :3] == pytest.approx(
        np.tile(STANDARD_PENDULUM.linear, (20, 1)), rel=0.001
    )


@pytest.mark.parametrize("forgetting_s", [5.0, 40.0])
def test_forgetting_equals_the_twin(native: Native, counts: tuple[Counts, Counts], forgetting_s: float) -> None:
    lanes = [configuration(seed, forgetting_s=forgetting_s).estimator for seed in range(3)]
    assert lanes[0].forgetting_groups > 0
    assert_lanes_equal([native], configuration(), lanes, *counts)


def test_many_stages_a_tick_equal_the_twin(native: Native) -> None:
    """200 Hz without decimation: several stages at every sample."""
    run = simulate(sensors=standard_sensors(14), sample_rate=200.0, truth="linear", duration=20.0, seed=1).run
    settings = replace(RIG.identifier, window_s=0.3, decimation=1, smoothing_s=0.075)
    config = weak_config_q31(replace(RIG, identifier=settings), 200.0, standard_start(0))
    assert config.design.window == 61
    assert WeakTwinQ31(config).stages_per_tick >= 5
    twin = assert_lanes_equal([native], config, [config.estimator], *counts_of(RIG, run))
    assert twin.estimator.counters["updates"][0] > 0


def test_a_zeroed_encoder_equals_the_twin(native: Native, counts: tuple[Counts, Counts]) -> None:
    lanes = [configuration(seed, zero_unknown=False).estimator for seed in range(3)]
    assert_lanes_equal([native], configuration(zero_unknown=False), lanes, *counts)


@pytest.mark.parametrize(("gain", "divider"), [(0, 1), (2**28, 1), (2**30, 3)])
def test_laws_and_divider_equal_the_twin(
    native: Native, counts: tuple[Counts, Counts], gain: int, divider: int
) -> None:
    lanes = [replace(configuration(seed).estimator, gain=gain, divider=divider) for seed in range(3)]
    assert_lanes_equal([native], configuration(), lanes, *(c[:15000] for c in counts))


@pytest.mark.parametrize(
    "sizes", [{"decimation": 1, "window_s": 0.15}, {"decimation": 2, "window_s": 0.4}, {"test_functions": 16}]
)
def test_other_sizes_equal_the_twin(native: Native, counts: tuple[Counts, Counts], sizes: dict[str, Any]) -> None:
    functions = {"test_functions": 4} if "decimation" in sizes else {}
    config = configuration(**{**sizes, **functions})
    # after so many ticks no window is in work, whose solves the core counts before the twin does
    assert_lanes_equal([native], config, [config.estimator], *(c[:8020] for c in counts))


HOSTILE = (
    "square waves",
    "slow square waves",
    "steps",
    "stuck",
    "wrap",
    "zeros",
    "random words",
    "full scale in phase",
    "one count",
    "beyond full scale",
)


def hostile(name: str, config: WeakConfigQ31, ticks: int = 8000) -> tuple[Counts, Counts]:
    """Counts that no mechanism makes."""
    design = config.design
    random = np.random.default_rng(7)
    t = np.arange(ticks)
    phi, y = np.zeros(ticks, np.int64), np.zeros(ticks, np.int64)
    # the largest swing of the pivot at 8 Hz that u_max lets pass, and a little less
    largest_u = 0.9 * design.u_max * 2.0**-design.u_bits / design.dt**2
    rate = 2 * np.pi * 8.0
    amplitude = largest_u * RIG.l1 / rate**2 / RIG.sensor.y_lsb
    assert amplitude < design.y_max
    swing = np.rint(amplitude * np.sin(rate * t / 1000)).astype(np.int64)
    if name == "square waves":
        phi = design.phi_max * np.where(t // 50 % 2, 1, -1)
        y = design.y_max * np.where(t // 70 % 2, 1, -1)
    elif name == "slow square waves":
        phi = design.phi_max * np.where(t // 125 % 2, 1, -1)
        y = swing
    elif name == "steps":
        phi = design.phi_max * (t > 4000)
        y = np.where(t > 6000, design.y_max, 0)
    elif name == "stuck":
        phi = np.full(ticks, design.phi_max)
        y = swing
    elif name == "wrap":
        phi = (t * 7) % 2**14 - 2**13
        y = swing
    elif name == "random words":
        phi = random.integers(-(2**31), 2**31, ticks)
        y = random.integers(-(2**31), 2**31, ticks)
        phi[2000:] = random.integers(-design.phi_max, design.phi_max + 1, ticks - 2000)
        y[2000:] = swing[2000:]
    elif name == "full scale in phase":
        phi = np.where(swing > 0, design.phi_max, -design.phi_max)
        y = swing
    elif name == "one count":
        phi = (t // 300) % 2
        y = swing
    elif name == "beyond full scale":
        phi = swing // 4
        y = swing
        phi[5000] = design.phi_max + 1
        y[7001] = -(2**31)
    return np.asarray(phi, np.int64), np.asarray(y, np.int64)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_counts_equal_the_twin(native: Native, name: str) -> None:
    config = configuration()
    for tau in (0.0, 5.0):
        lanes = [configuration(seed, forgetting_s=tau).estimator for seed in range(2)]
        assert_lanes_equal([native], config, lanes, *hostile(name, config))
    gated = replace(config, gate=GateConfigQ31(2 << 16, 20))
    assert_lanes_equal([native], gated, [config.estimator], *hostile(name, config))


def test_a_quarter_of_full_scale_in_phase_becomes_rows(native: Native) -> None:
    """What no mechanism does still passes the windows: hostile counts are not merely refused at the door."""
    config = configuration()
    phi, y = hostile("full scale in phase", config)
    core = native.identifier(config)
    core.run(phi // 4, y)
    assert core.counters["rows"] >= 8 * config.design.functions


def test_a_sample_beyond_full_scale_costs_a_window_and_no_more(native: Native, counts: tuple[Counts, Counts]) -> None:
    phi, y = (c.copy() for c in counts)
    config = configuration()
    phi[20000] = config.design.phi_max + 1
    core = native.identifier(config)
    record = core.run(phi, y)
    assert record.reason[20000] == Reason.REJECTED_SATURATED
    assert core.counters["rejected_saturated"] == 1
    assert p_of(config, record.p[-1])[:3] == pytest.approx(STANDARD_PENDULUM.linear, rel=0.001)


def test_a_run_in_pieces_is_the_same_run(native: Native, counts: tuple[Counts, Counts]) -> None:
    whole = native.identifier(configuration())
    whole.run(*counts)
    pieces = native.identifier(configuration())
    for part in np.array_split(np.arange(len(counts[0])), 7):
        pieces.run(counts[0][part], counts[1][part])
    assert pieces.running_hash == whole.running_hash
