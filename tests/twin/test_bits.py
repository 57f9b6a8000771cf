"""Bit equality of the C core and its numpy twin: every build, law, forgetting and differentiator, 20 starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from lanes import assert_lanes_equal

from pvid.compare.bits import compare_run, first_difference
from pvid.core.native import Native
from pvid.design.fir import savitzky_golay
from pvid.rig.file import Differentiator, RigFile
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig, StrongConfig
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    Drive,
    Simulation,
    simulate,
    standard_sensors,
    standard_start,
)
from pvid.twin.strong import StrongTwin, lanes_of

RATE = 1000.0
STARTS = 3
DIFFERENTIATORS: tuple[Differentiator, ...] = ("finite-difference", "savitzky-golay")


def configuration(differentiator: Differentiator) -> StrongConfig:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", differentiator=differentiator, stride=1)
    # every row is taken in, also where five points make the pivot sensor's noise larger than its motion
    return replace(strong_config(replace(rig, identifier=settings), RATE), drive_min=0.0)


def variants(config: EstimatorConfig) -> list[EstimatorConfig]:
    """Both laws, with and without forgetting; a solve at every row and staged."""
    return [
        replace(config, law=law, forgetting_s=tau, divider=divider)
        for law in Law
        for tau in (0.0, 2.0)
        for divider in (1, 8)
    ]


def test_matrix_cases_match_their_names(matrix: dict[str, Native]) -> None:
    for name, native in matrix.items():
        compiler, level = name.split("-")
        assert native.build.startswith(compiler)
        assert f"-{level}" in native.build
        assert "-ffp-contract=off" in native.build
        assert native.arithmetic_faults() == 0


@pytest.mark.ticks(short=1500, long=40_000)
@pytest.mark.parametrize("differentiator", DIFFERENTIATORS)
def test_many_starts_equal_the_twin_in_every_build(
    differentiator: Differentiator, matrix: dict[str, Native], standard_20_bits: Simulation, ticks: int
) -> None:
    """Both laws, with and without forgetting, a solve at every row and staged, from some starts."""
    run, config = standard_20_bits.run, configuration(differentiator)
    starts = [standard_start(seed) for seed in range(STARTS)]
    lanes = [lane for variant in variants(config.estimator) for lane in lanes_of(variant, starts)]
    compared = assert_lanes_equal(matrix.values(), config, run.phi[:ticks], run.y[:ticks], lanes, hashed_ticks=300)
    assert {int(reason) for lane in compared for reason in lane.record.reason} >= {Reason.UPDATED, Reason.ACCUMULATED}


@pytest.mark.parametrize(
    ("exact_every", "estimator"),
    [
        (1, {}),
        (1, {"law": Law.PSEUDOVELOCITY}),
        (5, {"forgetting_s": 0.05}),
        (0, {"divider": 3}),
        (0, {"divider": 12, "forgetting_s": 0.3, "feedback_hz": 3.0}),
        (0, {"divider": 64}),
        (0, {"dead_zone": 1.0}),
        (0, {"divider": 5, "dead_zone": 1.0}),
    ],
)
def test_every_schedule_equals_the_twin(
    exact_every: int, estimator: dict[str, Any], native: Native, standard_20_bits: Simulation
) -> None:
    run, config = standard_20_bits.run, replace(configuration("finite-difference"), exact_every=exact_every, stride=20)
    lane = replace(config.estimator, **estimator)
    (compared,) = assert_lanes_equal([native], config, run.phi[:900], run.y[:900], [lane])
    assert compared.counters["updates"] + compared.counters["in_dead_zone"] > 0


@pytest.mark.parametrize(("points", "stride", "block"), [(35, 1, 9), (31, 2, 7), (13, 3, 1)])
def test_a_window_of_blocks_equals_the_twin(
    points: int, stride: int, block: int, native: Native, standard_20_bits: Simulation
) -> None:
    run, bank = standard_20_bits.run, savitzky_golay(points, 10, stride, block)
    config = replace(configuration("savitzky-golay"), weights=bank.weights32, stride=stride, block=block)
    phi = run.phi[:1500].copy()
    phi[[20, 700]] = np.nan
    (compared,) = assert_lanes_equal([native], config, phi, run.y[:1500])
    assert compared.counters["rejected_not_finite"] == 2
    assert compared.counters["rows"] == sum(max(samples // block - bank.memory + 1, 0) for samples in (20, 679, 799))


def test_a_schedule_changes_the_estimate_by_less_than_a_thirtieth_of_its_error(native: Native) -> None:
    """The form's own error with 20 bits; `pvid bench strong` has 40 seeds."""
    distance: dict[str, list[npt.NDArray[np.float64]]] = {"lazy": [], "staged": []}
    errors = []
    for seed in range(6):
        sensors = replace(standard_sensors(20), random_offset=False)
        run = simulate(sensors=sensors, truth="linear", sample_rate=50.0, duration=40.0, seed=seed).run
        rig = replace(RigFile.standard(), identifier=replace(RigFile.standard().identifier, form="strong"))
        rig = replace(rig, identifier=replace(rig.identifier, differentiator="finite-difference"))
        config = strong_config(rig, 50.0, standard_start(seed))
        staged = replace(config, estimator=replace(config.estimator, divider=8))
        exact, *others = (
            native.identifier(one).run(run.phi, run.y, sums=False, hashes=False).p[-1].astype(np.float64)
            for one in (replace(config, exact_every=1), config, staged)
        )
        errors.append(exact / STANDARD_PENDULUM.linear - 1)
        for name, p in zip(distance, others, strict=True):
            distance[name].append(p / exact - 1)
    own = np.sqrt(np.mean(np.square(errors), axis=0))
    for found in distance.values():
        assert (np.sqrt(np.mean(np.square(found), axis=0)) < own / 30).all()


def test_a_changed_bit_is_found_and_named(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("finite-difference")
    phi = run.phi[:500].copy()
    twin = StrongTwin(config).run(phi, run.y[:500])
    phi[300] = np.nextafter(np.float32(phi[300]), np.float32(1))
    record = native.identifier(config).run(phi, run.y[:500])
    difference = first_difference(record, twin.lane())
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
        record = native.identifier(config).run(phi, y)
        assert np.isfinite(record.p).all()
        assert np.isfinite(record.sums).all()


def test_a_drive_that_comes_and_goes_equals_the_twin(native: Native) -> None:
    drive = Drive(STANDARD_DRIVE, on=((2.0, 5.0), (11.0, 14.0)))
    run = simulate(drive=drive, sensors=standard_sensors(20), duration=16.0).run
    config = replace(configuration("savitzky-golay"), drive_min=2.0)
    outcome = compare_run(native, config, run.phi, run.y)
    assert outcome.equal, outcome.difference
    reasons = native.identifier(config).run(run.phi, run.y).reason
    assert set(reasons[:2000]) == {Reason.WARMING_UP, Reason.HELD_NOT_EXCITED}
    assert (reasons[4000:5000] == Reason.UPDATED).all()
    assert (reasons[10000:11000] == Reason.HELD_NOT_EXCITED).all()
    assert (reasons[13000:14000] == Reason.UPDATED).all()


def test_a_run_in_two_pieces_has_the_bits_of_one(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("savitzky-golay")
    whole = native.identifier(config)
    whole.run(run.phi[:5000], run.y[:5000])
    pieces = native.identifier(config)
    pieces.run(run.phi[:1234], run.y[:1234])
    pieces.run(run.phi[1234:5000], run.y[1234:5000])
    assert pieces.running_hash == whole.running_hash


def test_published_estimates_equal_the_twin(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = configuration("savitzky-golay")
    for ticks in (0, 100, 400, 2000):
        identifier = native.identifier(config)
        identifier.run(run.phi[:ticks], run.y[:ticks])
        twin = StrongTwin(config)
        twin.run(run.phi[:ticks], run.y[:ticks])
        assert identifier.assess().tobytes() == twin.estimator.assess()[0].tobytes(), ticks
