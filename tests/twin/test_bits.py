"""Bit equality of the C core and its numpy twin: every build, law, forgetting and differentiator, 20 starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.native import Native
from pvid.rig.file import Differentiator, RigFile
from pvid.rig.run import Run
from pvid.run.compare import compare_run, first_difference
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig, StrongConfig
from pvid.settings.record import Record
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import STANDARD_DRIVE, Drive, Simulation, simulate, standard_sensors, standard_start
from pvid.twin import fnv
from pvid.twin.f32.gate import Gate
from pvid.twin.kapitza import strong as model
from pvid.twin.record import TwinRecord
from pvid.twin.rows import run_rows
from pvid.twin.strong import StrongTwin, lanes_of

RATE = 1000.0
STARTS = 20
PIECE = 1000
BUILDS = ("gcc-O0", "gcc-O2", "gcc-O3", "clang-O0", "clang-O2", "clang-O3")
DIFFERENTIATORS: tuple[Differentiator, ...] = ("finite-difference", "savitzky-golay")


def configuration(differentiator: Differentiator) -> StrongConfig:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", differentiator=differentiator, stride=1)
    # every row is taken in, also where five points make the pivot sensor's noise larger than its motion
    return replace(strong_config(replace(rig, identifier=settings), RATE), drive_min=0.0)


def window(config: StrongConfig) -> int:
    """Samples before the first that makes a row."""
    return 2 * int(config.weights.shape[1]) * config.stride


def variants(config: EstimatorConfig) -> list[EstimatorConfig]:
    """Both laws, with and without forgetting."""
    return [replace(config, law=law, forgetting_s=tau) for law in Law for tau in (0.0, 2.0)]


def test_matrix_cases_match_their_names(matrix: dict[str, Native]) -> None:
    assert set(matrix) == set(BUILDS)
    for name, native in matrix.items():
        compiler, level = name.split("-")
        assert native.build.startswith(compiler)
        assert f"-{level}" in native.build
        assert "-ffp-contract=off" in native.build
        assert native.arithmetic_faults() == 0


class GateOfSome(Gate):
    """The gate of a twin in some lanes [lanes]: it lets pass whatever comes to the others."""

    def __init__(self, twin: StrongTwin, lanes: npt.NDArray[np.bool_]) -> None:
        vars(self).update(vars(twin.gate))
        self.lanes = lanes

    def passes(self, square: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        return super().passes(square) | ~self.lanes


class Group:
    """Cores behind one differentiator in every build: estimators that take rows, whole identifiers that take samples.

    The samples begin where they give the first row at the tick `first_row` of the run, so that all groups can be lanes
    of one twin.
    """

    def __init__(self, config: StrongConfig, natives: list[Native], run: Run, first_row: int, rows: int) -> None:
        self.natives = natives
        starts = [standard_start(seed) for seed in range(STARTS)]
        whole = variants(config.estimator)
        fed_rows = [lane for variant in whole for lane in lanes_of(variant, starts)]
        self.lanes = fed_rows + whole
        self.is_whole = [False] * len(fed_rows) + [True] * len(whole)
        self.estimators = [[native.estimator(lane, RATE) for native in natives] for lane in fed_rows]
        self.identifiers = [
            [native.identifier(replace(config, estimator=lane)) for native in natives] for lane in whole
        ]
        warming_up = window(config)
        phi, y = (x[first_row - warming_up : first_row + rows] for x in (run.phi, run.y))
        n, row_y, row_reason = StrongTwin(config).rows(phi, y)
        assert (row_reason[:warming_up] == Reason.WARMING_UP).all()
        assert (row_reason[warming_up:] == Reason.ACCUMULATED).all()
        self.n, self.row_y = n[warming_up:], row_y[warming_up:]
        self.phi, self.y = phi[warming_up:], y[warming_up:]
        self.hashes = [self._warm_up(k, phi[:warming_up], y[:warming_up]) for k in range(len(whole))]

    def _warm_up(self, k: int, phi: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> int:
        """Feeds identifier k until its next sample makes a row; returns its hash."""
        start = np.asarray(self.lanes[len(self.estimators) + k].start, np.float32)
        p, sums = np.tile(start, (len(phi), 1)), np.zeros((len(phi), model.SUMS), np.float32)
        reported = np.full(len(phi), Reason.WARMING_UP, np.uint8)
        return self._compare_identifiers(k, phi, y, Record(p, sums, reported), fnv.START)

    def _compare_identifiers(
        self, k: int, phi: npt.NDArray[np.float64], y: npt.NDArray[np.float64], own: Record, hashed: int
    ) -> int:
        hashes = fnv.running_hashes(own, hashed)
        for native, identifier in zip(self.natives, self.identifiers[k], strict=True):
            record = identifier.run(phi, y)
            assert first_difference(record, own) is None, native.build
            assert np.array_equal(record.hash, hashes), native.build
        return int(hashes[-1])

    def compare(self, part: slice, twin: TwinRecord, first_lane: int) -> None:
        """Asserts that every build has the bits of its lane of the twin after every row of a part."""
        for lane in range(len(self.lanes)):
            own = twin.lane(first_lane + lane)
            if self.is_whole[lane]:
                k = lane - len(self.estimators)
                self.hashes[k] = self._compare_identifiers(k, self.phi[part], self.y[part], own, self.hashes[k])
                continue
            own.reason[own.reason == Reason.MISFIT] = Reason.UPDATED  # the verdict is the identifier's
            for native, estimator in zip(self.natives, self.estimators[lane], strict=True):
                record = estimator.run(self.n[part], self.row_y[part], hashes=False)
                assert first_difference(record, own) is None, native.build


@pytest.mark.ticks(short=3000, long=40_000)
def test_twenty_starts_and_whole_identifiers_equal_the_twin_in_every_build(
    matrix: dict[str, Native], standard_20_bits: Simulation, ticks: int
) -> None:
    """Both differentiators, both laws, with and without forgetting: 168 lanes of one twin, compared at every row."""
    configs = [configuration(of) for of in DIFFERENTIATORS]
    natives = [matrix[name] for name in BUILDS]
    first_row = max(window(config) for config in configs)
    groups = [Group(config, natives, standard_20_bits.run, first_row, ticks) for config in configs]
    rows, lanes = len(groups[0].row_y), len(groups[0].lanes)
    assert rows == ticks
    twin = StrongTwin(configs[0], [lane for group in groups for lane in group.lanes])
    gate = GateOfSome(twin, np.array([whole for group in groups for whole in group.is_whole]))
    for first in range(0, rows, PIECE):
        part = slice(first, first + PIECE)
        n = np.repeat(np.stack([group.n[part] for group in groups], axis=2), lanes, axis=2)
        y = np.repeat(np.stack([group.row_y[part] for group in groups], axis=1), lanes, axis=1)
        expected = run_rows(twin.estimator, lambda n, y: twin.estimator.step(n, y, gate, twin.misfit), n, y)
        for place, group in enumerate(groups):
            group.compare(part, expected, place * lanes)


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
