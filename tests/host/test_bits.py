"""Bit equality of the C core and its numpy twin: every build, law, forgetting and differentiator, 20 starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvid.compare import compare_lanes, compare_run, first_difference
from pvid.native import EstimatorConfig, Law, Native, Reason, StrongConfig
from pvid.rig import STANDARD_DRIVE, Drive, Simulation, simulate, standard_sensors, standard_start
from pvid.rigfile import Differentiator, RigFile
from pvid.setup import strong_config
from pvid.twin import fnv
from pvid.twin.strong import StrongTwin, lanes_of

STARTS = 20
BUILDS = ("gcc-O0", "gcc-O2", "gcc-O3", "clang-O0", "clang-O2", "clang-O3")
DIFFERENTIATORS: tuple[Differentiator, ...] = ("finite-difference", "savitzky-golay")


def configuration(differentiator: Differentiator) -> StrongConfig:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", differentiator=differentiator, stride=1)
    # every row is taken in, also where five points make the pivot sensor's noise larger than its motion
    return replace(strong_config(replace(rig, identifier=settings), 1000.0), drive_min=0.0)


def variants(config: EstimatorConfig) -> list[EstimatorConfig]:
    """Both laws, with and without forgetting."""
    return [replace(config, law=law, forgetting_s=tau) for law in Law for tau in (0.0, 2.0)]


def test_the_matrix_holds_what_its_names_say(matrix: dict[str, Native]) -> None:
    assert set(matrix) == set(BUILDS)
    for name, native in matrix.items():
        compiler, level = name.split("-")
        assert native.build.startswith(compiler)
        assert f"-{level}" in native.build
        assert "-ffp-contract=off" in native.build
        assert native.arithmetic_faults() == 0


@pytest.mark.parametrize("differentiator", DIFFERENTIATORS)
def test_whole_identifier_equals_the_twin_in_every_build(
    differentiator: Differentiator, matrix: dict[str, Native], standard_20_bits: Simulation
) -> None:
    run = standard_20_bits.run
    config = configuration(differentiator)
    lanes = variants(config.estimator)
    twin = StrongTwin(config, lanes).run(run.phi, run.y)
    assert len(run.t) >= 40_000
    for lane, estimator in enumerate(lanes):
        p, sums, reason = twin.p[:, :, lane], twin.sums[:, :, lane], twin.reason[:, lane]
        hashes = fnv.running_hashes(p, sums, reason)
        for name in BUILDS:
            record = matrix[name].strong(replace(config, estimator=estimator)).run(run.phi, run.y)
            assert first_difference(record, p, sums, reason) is None, name
            assert np.array_equal(record.hash, hashes), name


@pytest.mark.parametrize("differentiator", DIFFERENTIATORS)
def test_twenty_starts_equal_the_twin_in_every_build(
    differentiator: Differentiator, matrix: dict[str, Native], standard_20_bits: Simulation
) -> None:
    run = standard_20_bits.run
    config = configuration(differentiator)
    n, y, fate = StrongTwin(config).rows(run.phi, run.y)
    ready = fate == Reason.ACCUMULATED
    assert ready.sum() >= 40_000
    starts = [standard_start(seed) for seed in range(STARTS)]
    lanes = [lane for variant in variants(config.estimator) for lane in lanes_of(variant, starts)]
    differing = compare_lanes([matrix[name] for name in BUILDS], lanes, n[ready], y[ready], 1000.0)
    assert not differing, [(native.build, lane, str(difference)) for native, lane, difference in differing[:3]]


def test_a_changed_bit_is_found_and_named(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("finite-difference")
    phi = run.phi[:500].copy()
    twin = StrongTwin(config).run(phi, run.y[:500])
    phi[300] = np.nextafter(np.float32(phi[300]), np.float32(1))
    record = native.strong(config).run(phi, run.y[:500])
    difference = first_difference(record, twin.p[:, :, 0], twin.sums[:, :, 0], twin.reason[:, 0])
    assert difference is not None
    assert difference.tick == 300  # five points: the newest sample enters at once
    assert difference.core_word != difference.twin_word


def test_hostile_samples_equal_the_twin(native: Native, standard_20_bits: Simulation) -> None:
    """NaN, infinity, a stuck sensor, full-scale steps and zeros: the same bits, and no NaN ever."""
    rng = np.random.default_rng(7)
    phi = standard_20_bits.run.phi[:3000].copy()
    y = standard_20_bits.run.y[:3000].copy()
    phi[100] = np.nan
    y[700] = np.inf
    phi[900:1000] = phi[900]
    phi[1200:1300] = 1e30 * rng.standard_normal(100)
    y[1500:1600] = rng.choice([-3.0, 3.0], 100)
    phi[1800:2000] = 0.0
    y[1800:2000] = 0.0
    for law in Law:
        config = configuration("finite-difference")
        config = replace(config, estimator=replace(config.estimator, law=law))
        outcome = compare_run(native, config, phi, y)
        assert outcome.equal, outcome.difference
        record = native.strong(config).run(phi, y)
        assert np.isfinite(record.p).all()
        assert np.isfinite(record.sums).all()


def test_a_drive_that_comes_and_goes_equals_the_twin(native: Native) -> None:
    drive = Drive(STANDARD_DRIVE, on=((2.0, 5.0), (11.0, 14.0)))
    run = simulate(drive=drive, sensors=standard_sensors(20), duration=16.0).run
    config = replace(configuration("savitzky-golay"), drive_min=2.0)
    outcome = compare_run(native, config, run.phi, run.y)
    assert outcome.equal, outcome.difference
    reasons = native.strong(config).run(run.phi, run.y).reason
    assert set(reasons[:2000]) == {Reason.WARMING_UP, Reason.HELD_NOT_EXCITED}
    assert (reasons[4000:5000] == Reason.UPDATED).all()
    assert (reasons[10000:11000] == Reason.HELD_NOT_EXCITED).all()
    assert (reasons[13000:14000] == Reason.UPDATED).all()


def test_a_run_in_two_pieces_has_the_bits_of_one(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("savitzky-golay")
    whole = native.strong(config)
    whole.run(run.phi[:5000], run.y[:5000])
    pieces = native.strong(config)
    pieces.run(run.phi[:1234], run.y[:1234])
    pieces.run(run.phi[1234:5000], run.y[1234:5000])
    assert pieces.running_hash == whole.running_hash


def test_published_estimates_equal_the_twin(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("savitzky-golay")
    for ticks in (0, 100, 400, 2000):
        identifier = native.strong(config)
        identifier.run(run.phi[:ticks], run.y[:ticks])
        twin = StrongTwin(config)
        twin.run(run.phi[:ticks], run.y[:ticks])
        assert identifier.assess().tobytes() == twin.estimator.assess()[0].tobytes(), ticks
