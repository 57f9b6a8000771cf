"""The fixed-point strong form in C and its numpy twin, integer by integer: builds, laws, hostile counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hostile_counts import HOSTILE, hostile
from lanes import assert_lanes_equal

from pvid.compare.bits import first_difference
from pvid.core.native import Native
from pvid.rig.file import Differentiator, RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, StrongConfigQ31
from pvid.settings.tables import RowFormatQ31
from pvid.setup.q31 import counts_of, strong_config_q31
from pvid.sim.pendulum import STANDARD_DRIVE, Drive, Simulation, simulate, standard_sensors, standard_start
from pvid.twin.kapitza import strong_q31 as kapitza_strong_q31
from pvid.twin.kapitza.estimator_q31 import KapitzaEstimatorQ31
from pvid.twin.strong_q31 import StrongTwinQ31, run_rows

STARTS = 20
PIECE = 2000
STRIDE: dict[Differentiator, int] = {"finite-difference": 20, "savitzky-golay": 1}
LAWS = ("stationary", "pseudovelocity")
Counts = npt.NDArray[np.int64]


def rig_of(differentiator: Differentiator = "savitzky-golay", law: str = "stationary", tau: float = 0.0) -> RigFile:
    """The standard rig with an encoder of 20 bits."""
    rig = RigFile.standard()
    settings = replace(
        rig.identifier,
        form="strong",
        differentiator=differentiator,
        stride=STRIDE[differentiator],
        law=law,  # type: ignore[arg-type]
        forgetting_s=tau,
    )
    return replace(rig, identifier=settings, sensor=replace(rig.sensor, phi_lsb=standard_sensors(20).phi_lsb))


def configuration(rig: RigFile, seed: int = 0) -> StrongConfigQ31:
    """Its settings at 1 kHz, a start within 50 % of the truth; every row is taken in."""
    return replace(strong_config_q31(rig, 1000.0, standard_start(seed)), drive_min=0)


def counts(run: Run) -> tuple[Counts, Counts]:
    return counts_of(rig_of(), run)


def reasons_of(natives: list[Native], config: StrongConfigQ31, phi: Counts, y: Counts) -> npt.NDArray[np.uint8]:
    """Compares every build with the twin; what every tick told."""
    return assert_lanes_equal(natives, config, phi, y, hashed_ticks=len(phi))[0].record.reason


@pytest.mark.parametrize("differentiator", STRIDE)
def test_the_whole_identifier_equals_the_twin_in_every_build(
    matrix: dict[str, Native], standard_20_bits: Simulation, differentiator: Differentiator
) -> None:
    phi, y = counts(standard_20_bits.run)
    config = configuration(rig_of(differentiator))
    reason = reasons_of(list(matrix.values()), config, phi[:1500], y[:1500])
    assert (reason == Reason.UPDATED).sum() >= 1200


@pytest.mark.ticks(short=1000, long=40_000)
def test_twenty_starts_with_both_laws_with_and_without_forgetting_equal_the_twin(
    native: Native, standard_20_bits: Simulation, ticks: int
) -> None:
    """Rows through eighty estimators and one twin of eighty lanes, compared after every tick."""
    rows, row_reason = StrongTwinQ31(configuration(rig_of())).rows(*counts(standard_20_bits.run))
    ready = row_reason == Reason.UPDATED
    rigs = [rig_of(law=law, tau=tau) for law in LAWS for tau in (0.0, 2.0)]
    lanes = [configuration(rig, seed).estimator for rig in rigs for seed in range(STARTS)]
    assert len({(lane.gain, lane.forgetting_groups) for lane in lanes}) == 4
    assert_rows_equal(native, lanes, configuration(rig_of()).row, rows[ready][:ticks])


def assert_rows_equal(native: Native, lanes: list[EstimatorConfigQ31], row_format: RowFormatQ31, rows: Counts) -> None:
    twin = KapitzaEstimatorQ31(lanes, row_format)
    cores = [native.strong_estimator_q31(lane, row_format) for lane in lanes]
    for first in range(0, len(rows), PIECE):
        part = slice(first, first + PIECE)
        expected = run_rows(twin, rows[part])
        for lane, core in enumerate(cores):
            assert first_difference(core.run_rows(rows[part], hashes=False), expected.lane(lane)) is None, (
                first,
                lane,
            )
    for lane, core in enumerate(cores):
        assert core.assess().tobytes() == twin.assess()[lane].tobytes()


def hostile_to(name: str, config: StrongConfigQ31, ticks: int) -> tuple[Counts, Counts]:
    """For the bank's full scales; the pivot swings by 10 mm."""
    bank = config.design.bank
    swing = np.rint(2000 * np.sin(2 * np.pi * 4.0 * np.arange(ticks) / 1000)).astype(np.int64)
    return hostile(name, (bank.phi_max, bank.y_max), swing, 2**20)


@pytest.mark.ticks(short=350, long=700)
@pytest.mark.parametrize("differentiator", STRIDE)
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_counts_equal_the_twin(native: Native, name: str, differentiator: Differentiator, ticks: int) -> None:
    for law, tau in zip(LAWS, (0.0, 0.5), strict=True):
        config = configuration(rig_of(differentiator, law, tau))
        reasons_of([native], config, *hostile_to(name, config, ticks))
        reasons_of([native], replace(config, gate=GateConfigQ31(2 << 16, 50)), *hostile_to(name, config, ticks))


def test_hostile_counts_reach_the_arithmetic(native: Native) -> None:
    taken = 0
    for name in HOSTILE:
        config = configuration(rig_of("finite-difference"))
        core = native.identifier(config)
        core.run(*hostile_to(name, config, 700))
        taken += core.counters["rows"] > 250
    assert taken >= 5


def test_hostile_rows_equal_the_twin(native: Native) -> None:
    """Derivatives up to their limit in any order, as no bank makes them: rows fit or are refused in both alike."""
    random = np.random.default_rng(5)
    config = configuration(rig_of())
    phi = random.integers(-(2**30), 2**30 + 1, (4000, 5)) >> random.integers(0, 31, (4000, 5))
    u = random.integers(-(2**30), 2**30 + 1, (4000, 3)) >> random.integers(0, 31, (4000, 3))
    phi[:4], u[:4] = 2**30, -(2**30)
    u[:, 0] //= 2  # rates end there
    rows, fits = native.strong_rows_q31(config.row, phi, u)
    expected, expected_fits = kapitza_strong_q31.rows(config.row, phi, u)
    assert np.array_equal(fits, expected_fits)
    assert 400 < fits.sum() < 3600
    assert np.array_equal(rows[fits], expected[fits])
    for row in rows[fits][:40]:  # on their own: an estimator takes them or refuses them as its twin
        assert_rows_equal(native, [config.estimator], config.row, np.stack([row] * 20))


def test_far_from_the_reference_a_solve_equals_the_twin(native: Native, standard_20_bits: Simulation) -> None:
    """w at its bounds and between: shifts of the moments in 64 bits, and units of time."""
    config = configuration(rig_of())
    rows, row_reason = StrongTwinQ31(config).rows(*counts(standard_20_bits.run))
    ready = rows[row_reason == Reason.UPDATED][:60]
    for w in np.geomspace(config.estimator.lower[0], config.estimator.upper[0], 8):
        for gain in (2**30, 0):
            lane = replace(config.estimator, start=(int(w), *config.estimator.start[1:]), gain=gain, step_limit=655)
            assert_rows_equal(native, [lane], config.row, ready)


def test_sums_that_reach_their_limit_are_divided_and_grow_again(native: Native) -> None:
    """Rows at the limit of their format, then small ones with forgetting: the exponent rises and falls."""
    random = np.random.default_rng(3)
    config = strong_config_q31(rig_of(), 1000.0)
    rows = np.zeros((700, 13), np.int64)
    rows[:, :2] = random.integers(-(2**28), 2**28 + 1, (700, 2))  # A and E alone: w is not observed, and p stays
    rows[200:] >>= 14
    rows[:, 12] = config.row.reference  # G of a still pivot
    lanes = [replace(config.estimator, forgetting_groups=groups) for groups in (0, 100)]
    core = native.strong_estimator_q31(lanes[1], config.row)
    exponent = core.run_rows(rows, hashes=False).exponent
    assert exponent.max() > exponent[-1]
    for lane in lanes:
        assert_rows_equal(native, [lane], config.row, rows)


def test_a_drive_that_comes_and_goes_equals_the_twin(native: Native) -> None:
    drive = Drive(STANDARD_DRIVE, on=((1.0, 2.0),))
    run = simulate(drive=drive, sensors=standard_sensors(20), duration=4.0).run
    config = strong_config_q31(rig_of(), 1000.0)
    reason = reasons_of([native], config, *counts(run))
    assert set(reason[:1000]) == {Reason.WARMING_UP, Reason.HELD_NOT_EXCITED}
    assert (reason[1500:2000] == Reason.UPDATED).all()


def test_a_sample_beyond_full_scale_costs_a_window_and_no_more(native: Native, standard_20_bits: Simulation) -> None:
    phi, y = counts(standard_20_bits.run)
    config = configuration(rig_of())
    phi = phi.copy()
    phi[5000] = config.design.bank.phi_max + 1
    core = native.identifier(config)
    record = core.run(phi[:8000], y[:8000])
    window = config.design.bank.window
    assert record.reason[5000] == Reason.REJECTED_SATURATED
    assert (record.reason[5001 : 5000 + window] == Reason.WARMING_UP).all()
    assert (record.reason[5000 + window :] == Reason.UPDATED).all()
    assert core.counters["rejected_saturated"] == 1


def test_a_run_in_pieces_is_the_same_run(native: Native, standard_20_bits: Simulation) -> None:
    phi, y = counts(standard_20_bits.run)
    whole = native.identifier(configuration(rig_of()))
    whole.run(phi, y)
    pieces = native.identifier(configuration(rig_of()))
    for part in np.array_split(np.arange(len(phi)), 7):
        pieces.run(phi[part], y[part])
    assert pieces.running_hash == whole.running_hash
