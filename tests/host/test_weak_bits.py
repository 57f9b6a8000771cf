"""Bit equality of the weak form: every build, law, forgetting, with and without the encoder's zero, 20 starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvid.compare import compare_run, first_difference
from pvid.native import EstimatorConfig, Law, Native, WeakConfig
from pvid.rig import Simulation, simulate, standard_sensors, standard_start
from pvid.rigfile import RigFile
from pvid.setup import weak_config
from pvid.twin import fnv
from pvid.twin.weak import WeakTwin

STARTS = 20


@pytest.fixture(scope="module")
def run() -> Simulation:
    """The standard rig with a 14-bit encoder, 40.5 s."""
    return simulate(sensors=standard_sensors(14), duration=40.5, seed=5)


def configuration(zero_unknown: bool) -> WeakConfig:
    rig = RigFile.standard()
    return weak_config(replace(rig, identifier=replace(rig.identifier, form="weak", zero=zero_unknown)), 1000.0)


def started(config: WeakConfig, seed: int) -> EstimatorConfig:
    """The same settings from another start."""
    p = standard_start(seed).astype(np.float32)
    start, start_sd = config.estimator.start.copy(), config.estimator.start_sd.copy()
    start[:3] = p
    start_sd[:3] = np.float32(0.5) * p
    return replace(config.estimator, start=start, start_sd=start_sd)


@pytest.mark.parametrize("zero_unknown", [True, False])
@pytest.mark.parametrize("law", list(Law))
@pytest.mark.parametrize("forgetting_s", [0.0, 10.0])
def test_twenty_starts_equal_the_twin_in_every_build(
    zero_unknown: bool, law: Law, forgetting_s: float, matrix: dict[str, Native], run: Simulation
) -> None:
    config = configuration(zero_unknown)
    lanes = [replace(started(config, seed), law=law, forgetting_s=forgetting_s) for seed in range(STARTS)]
    phi, y = run.run.phi, run.run.y
    assert len(phi) >= 40_000
    twin = WeakTwin(config, lanes).run(phi, y)
    for lane, estimator in enumerate(lanes):
        p, sums, reason = twin.p[:, :, lane], twin.sums[:, :, lane], twin.reason[:, lane]
        for name, native in matrix.items():
            record = native.weak(replace(config, estimator=estimator)).run(phi, y, hashes=False)
            assert first_difference(record, p, sums, reason) is None, (name, lane)
        if lane == 0:
            identifier = matrix["gcc-O2"].weak(replace(config, estimator=estimator))
            hashes = identifier.run(phi, y).hash
            assert np.array_equal(hashes, fnv.running_hashes(p, sums, reason))


def test_hostile_samples_equal_the_twin_and_leave_only_numbers(native: Native, run: Simulation) -> None:
    rng = np.random.default_rng(3)
    phi, y = run.run.phi[:12_000].copy(), run.run.y[:12_000].copy()
    phi[2000] = np.nan
    y[4500] = -np.inf
    phi[6000:6100] = 1e30 * rng.standard_normal(100)
    phi[7000:8500] = phi[7000]
    y[8500:8600] = rng.choice([-3.0, 3.0], 100)
    phi[9500:11_000] = 0.0
    y[9500:11_000] = 0.0
    config = configuration(True)
    outcome = compare_run(native, config, phi, y)
    assert outcome.equal, outcome.difference
    record = native.weak(config).run(phi, y)
    assert np.isfinite(record.p).all()
    assert np.isfinite(record.sums).all()


def test_a_run_in_pieces_has_the_bits_of_one(native: Native, run: Simulation) -> None:
    phi, y = run.run.phi[:9000], run.run.y[:9000]
    whole = native.weak(configuration(True))
    whole.run(phi, y)
    pieces = native.weak(configuration(True))
    for first, last in ((0, 1), (1, 1300), (1300, 4321), (4321, 9000)):
        pieces.run(phi[first:last], y[first:last])
    assert pieces.running_hash == whole.running_hash
