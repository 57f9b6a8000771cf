"""The fixed-point weak form in C and its numpy twin, integer by integer: builds, laws, sizes, hostile counts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hostile_counts import HOSTILE, hostile
from lanes import assert_lanes_equal

from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, WeakConfigQ31
from pvid.setup.q31 import counts_of, p_of, weak_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start
from pvid.twin.weak_q31 import WeakTwinQ31

BUILDS = ("gcc-O0", "gcc-O2", "gcc-O3", "clang-O0", "clang-O2", "clang-O3")
RIG = RigFile.standard()
Counts = npt.NDArray[np.int64]
HASHED_TICKS = 3000  # past the work on the first two windows


@pytest.fixture(scope="module")
def counts() -> tuple[Counts, Counts]:
    """The standard rig's counts, linear truth, 14 bits, 40 s at 1 kHz."""
    run = simulate(sensors=standard_sensors(14), truth="linear", seed=1).run
    return counts_of(RIG, run)


@cache
def configuration(seed: int = 0, zero_unknown: bool = True, **identifier: Any) -> WeakConfigQ31:
    """The standard rig's settings, a start within 50 % of the truth."""
    rig = replace(RIG, identifier=replace(RIG.identifier, zero=zero_unknown, **identifier))
    return weak_config_q31(rig, 1000.0, standard_start(seed))


def compared(
    natives: list[Native],
    config: WeakConfigQ31,
    lanes: list[EstimatorConfigQ31],
    phi: Counts,
    y: Counts,
    *,
    hashed_ticks: int = HASHED_TICKS,
) -> WeakTwinQ31:
    """Compares every build with the twin, and returns that."""
    twin: WeakTwinQ31 = assert_lanes_equal(natives, config, phi, y, lanes, hashed_ticks)[0].twin
    return twin


@pytest.mark.parametrize(("gain", "divider"), [(0, 1), (2**28, 1), (2**30, 3)])
def test_laws_and_divider_equal_the_twin(
    native: Native, counts: tuple[Counts, Counts], gain: int, divider: int
) -> None:
    lanes = [replace(configuration(seed).estimator, gain=gain, divider=divider) for seed in range(3)]
    compared([native], configuration(), lanes, *(c[:15000] for c in counts))


def hostile_to(name: str, config: WeakConfigQ31, ticks: int = 8000) -> tuple[Counts, Counts]:
    """For the design's full scales: the largest swing of the pivot at 8 Hz that u_max lets pass, and a little less."""
    design = config.design
    largest_u = 0.9 * design.u_max * 2.0**-design.u_bits / design.dt**2
    rate = 2 * np.pi * 8.0
    amplitude = largest_u * RIG.l1 / rate**2 / RIG.sensor.y_lsb
    assert amplitude < design.y_max
    swing = np.rint(amplitude * np.sin(rate * np.arange(ticks) / 1000)).astype(np.int64)
    return hostile(name, (design.phi_max, design.y_max), swing, 2**14)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_counts_equal_the_twin(native: Native, name: str) -> None:
    config = configuration()
    for tau in (0.0, 5.0):
        lanes = [configuration(seed, forgetting_s=tau).estimator for seed in range(2)]
        compared([native], config, lanes, *hostile_to(name, config))
    gated = replace(config, gate=GateConfigQ31(2 << 16, 20))
    compared([native], gated, [config.estimator], *hostile_to(name, config))


def test_a_quarter_of_full_scale_in_phase_becomes_rows(native: Native) -> None:
    """What no mechanism does still passes the windows: hostile counts are not merely refused at the door."""
    config = configuration()
    phi, y = hostile_to("full scale in phase", config)
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
