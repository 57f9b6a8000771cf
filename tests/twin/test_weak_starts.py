"""Bit equality of the weak form: every build, law, forgetting, zero, from 20 starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_rig import LINEAR_RIG

from pvid.core.native import Native
from pvid.run.compare import first_difference
from pvid.settings.enums import Law
from pvid.settings.f32 import EstimatorConfig, WeakConfig
from pvid.setup.f32 import weak_config
from pvid.sim.pendulum import Simulation, simulate, standard_sensors, standard_start
from pvid.twin import fnv
from pvid.twin.weak import WeakTwin

STARTS = 20


@pytest.fixture(scope="module")
def run() -> Simulation:
    """The standard rig with a 14-bit encoder, 40.5 s."""
    return simulate(sensors=standard_sensors(14), duration=40.5, seed=5)


def configuration(zero_unknown: bool) -> WeakConfig:
    return weak_config(replace(LINEAR_RIG, identifier=replace(LINEAR_RIG.identifier, zero=zero_unknown)), 1000.0)


def started(config: WeakConfig, seed: int) -> EstimatorConfig:
    """The same settings from another start."""
    p = standard_start(seed).astype(np.float32)
    start, start_sd = config.estimator.start.copy(), config.estimator.start_sd.copy()
    start[:3] = p
    start_sd[:3] = np.float32(0.5) * p
    return replace(config.estimator, start=start, start_sd=start_sd)


@pytest.mark.ticks(short=12_000, long=40_000)
@pytest.mark.parametrize("zero_unknown", [True, False])
@pytest.mark.parametrize("law", list(Law))
@pytest.mark.parametrize("forgetting_s", [0.0, 10.0])
def test_twenty_starts_equal_the_twin_in_every_build(
    zero_unknown: bool, law: Law, forgetting_s: float, matrix: dict[str, Native], run: Simulation, ticks: int
) -> None:
    config = configuration(zero_unknown)
    lanes = [replace(started(config, seed), law=law, forgetting_s=forgetting_s) for seed in range(STARTS)]
    phi, y = run.run.phi[:ticks], run.run.y[:ticks]
    twin = WeakTwin(config, lanes).run(phi, y)
    for lane, estimator in enumerate(lanes):
        own = twin.lane(lane)
        for name, native in matrix.items():
            record = native.identifier(replace(config, estimator=estimator)).run(phi, y, hashes=False)
            assert first_difference(record, own) is None, (name, lane)
        if lane == 0:
            identifier = matrix["gcc-O2"].identifier(replace(config, estimator=estimator))
            hashes = identifier.run(phi, y).hash
            assert np.array_equal(hashes, fnv.running_hashes(own))
