"""The core on every board: built by its cross compiler, run in its emulator, the bits of the host."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ROOT
from processes import PATIENCE_S

from bench.figures import results_of
from pvid.base.errors import PvidError
from pvid.board import mechanism_image, mechanism_image_q31, sizes
from pvid.board.boards import BOARDS, Board, run
from pvid.board.replay_image import BLOCK, REPORT_EVERY, ReplayReport, parse_report, play
from pvid.board.strong_image import hashes_of, standard_run
from pvid.board.weak_image import weak_image

FORMS_AND_CORES = [*sizes.ALL, (sizes.REFINED, "f32"), (sizes.IN_BLOCKS, "f32"), (sizes.IN_BLOCKS, "q31")]

Measured = dict[sizes.Configuration, tuple[sizes.Footprint, ReplayReport]]


# The short form: a processor with an FPU and one without; an AVR; and one form on RISC-V, in the long form on all.
FEW = ("mps2-an386", "microbit", *sizes.ON_AVR)
RISC_V, ON_ALL = "virt-rv32imac", ("weak", "f32")


@pytest.fixture(scope="module")
def measured(request: pytest.FixtureRequest) -> Measured:
    """Configurations of `pvid sizes`, built and run: in the long form all."""

    def is_measured(one: sizes.Configuration) -> bool:
        few = one.board.name in FEW or (one.board.name == RISC_V and (one.form, one.core) == ON_ALL)
        return few or bool(request.config.getoption("--long"))

    return {one: sizes.measure(one) for one in sizes.CONFIGURATIONS if is_measured(one)}


@cache
def refined_hashes(board: Board) -> npt.NDArray[np.uint32]:
    """Of both stages of the C core here; without a floating point unit a tick has fewer jobs."""
    replay = sizes.refined_replay(board)
    return replay.native().run_both(replay.weak.samples).hash


@cache
def expected_hashes(form: str, core: str) -> npt.NDArray[np.uint32]:
    """Running hash of the C core here after every tick of the run that `pvid sizes` plays; tests/twin and tests/codegen
    compare it with the twin's."""
    if form == "strong":
        return hashes_of(standard_run("kapitza"))
    if form == sizes.IN_BLOCKS and core == "q31":
        fixed = mechanism_image_q31.fixed_run("kapitza", long=True)
        return mechanism_image_q31.identifier_of(fixed).run_in_blocks(fixed.counts, BLOCK)
    if form == sizes.IN_BLOCKS:
        run = mechanism_image.mechanism_run("kapitza", long=True)
        return mechanism_image.identifier_of(run).run_in_blocks(run.samples, BLOCK)
    if core == "q31":
        return mechanism_image_q31.native_hashes(mechanism_image_q31.fixed_run("kapitza", long=True))
    return mechanism_image.native_hashes(mechanism_image.mechanism_run("kapitza", long=True))


def assert_same_hashes(report: ReplayReport, expected: npt.NDArray[np.uint32], every: int = 1) -> None:
    """every: ticks of a block; the hash of a report's tick is that behind its block."""
    assert report.ticks == len(expected)
    ends = [-(-tick // every) * every for tick in range(REPORT_EVERY, report.ticks + 1, REPORT_EVERY)]
    assert report.hashes == {end: int(expected[end - 1]) for end in ends}
    assert report.hash == int(expected[-1])


@pytest.mark.longer
@pytest.mark.parametrize(("form", "core"), FORMS_AND_CORES)
def test_every_board_computes_the_bits_of_the_host(
    form: str, core: str, measured: Measured, request: pytest.FixtureRequest
) -> None:
    boards = set()
    for configuration, (_, report) in measured.items():
        if (configuration.form, configuration.core) == (form, core):
            board = configuration.board
            expected = refined_hashes(board) if form == sizes.REFINED else expected_hashes(form, core)
            if board.toolchain == "avr":  # which plays less of the run
                assert report.ticks > 5000
                expected = expected[: report.ticks]
            assert_same_hashes(report, expected, BLOCK if form == sizes.IN_BLOCKS else 1)
            boards.add(board.name)
    on_all = BOARDS if request.config.getoption("--long") else (*FEW, RISC_V)
    wanted = on_all if (form, core) == ON_ALL else FEW
    there = {one.board.name for one in sizes.CONFIGURATIONS if (one.form, one.core) == (form, core)}
    assert boards >= there.intersection(wanted)


def test_the_weak_form_restarts_its_windows_alike_where_samples_are_missing() -> None:
    replay = mechanism_image.mechanism_run("kapitza")
    counts = replay.counts.copy()
    at = replay.measure_from
    counts[at : at + 7], counts[at + 900, 1] = mechanism_image.MISSING, mechanism_image.MISSING
    replay = replace(replay, counts=counts)
    assert np.isnan(replay.samples).any()
    image, _ = mechanism_image.build_mechanism_image(BOARDS["mps2-an386"], replay)
    assert_same_hashes(play(BOARDS["mps2-an386"], image, PATIENCE_S), mechanism_image.native_hashes(replay))


def mean_of(measured: Measured, board: str, form: str, core: str) -> int:
    """Instructions a tick."""
    return measured[sizes.Configuration(BOARDS[board], form, core)][0].mean


@pytest.mark.parametrize("board", ["microbit", pytest.param("virt-rv32imac", marks=pytest.mark.long)])
def test_integers_cost_a_third_of_soft_float_at_most(board: str, measured: Measured) -> None:
    assert 3 * mean_of(measured, board, "weak", "q31") <= mean_of(measured, board, "weak", "f32")


def test_the_weak_form_in_integers_keeps_its_limits(measured: Measured) -> None:
    """Instructions a tick in the mean on the smallest core and with a long multiplication; bytes of state on both."""
    for board, most in (("microbit", 510), ("mps2-an386", 260)):
        assert mean_of(measured, board, "weak", "q31") <= most, board
        assert measured[sizes.Configuration(BOARDS[board], "weak", "q31")][1].state_bytes <= 4096, board


def test_a_block_takes_three_times_the_mean_at_most(measured: Measured) -> None:
    footprint = measured[sizes.Configuration(BOARDS["mps2-an386"], sizes.IN_BLOCKS, "f32")][0]
    assert footprint.longest <= 3 * BLOCK * footprint.mean


@pytest.mark.longer
def test_no_figure_exceeds_its_budget(measured: Measured) -> None:
    footprints = {configuration: footprint for configuration, (footprint, _) in measured.items()}
    over = sizes.over_budget(ROOT / "tests" / "budget.toml", footprints)
    assert not over, "accept: ./tools/pvid sizes --budget tests/budget.toml --data host/docs/benchmarks"


@pytest.mark.longer
def test_the_table_of_results_has_what_is_measured(measured: Measured) -> None:
    shown = {row[:2]: row[2:] for row in results_of("sizes").rows}
    for row in sizes.table_rows({configuration: footprint for configuration, (footprint, _) in measured.items()}):
        figures = [int(cell) for cell in shown[row[:2]]]
        assert figures == pytest.approx([int(cell) for cell in row[2:]], rel=0.02), row


@pytest.mark.longer
def test_the_stack_that_is_seen_lies_within_the_bound(measured: Measured) -> None:
    for configuration, (footprint, report) in measured.items():
        assert 0 < footprint.stack_seen <= footprint.stack_bound < report.stack_size, configuration.name


def test_a_figure_over_its_budget_is_named(tmp_path: Path) -> None:
    configuration = sizes.CONFIGURATIONS[0]
    footprint = sizes.Footprint(1000, 0, 0, 0, 0, 100, 100, 50, 60)
    budget = tmp_path / "budget.toml"
    budget.write_text(f"{sizes.OPENING}\n{sizes.CLOSING}\n", encoding="utf-8")
    assert len(sizes.over_budget(budget, {configuration: footprint})) == 9  # none has one
    sizes.write_budget(budget, {configuration: footprint})
    assert sizes.over_budget(budget, {configuration: footprint}) == []
    larger = sizes.Footprint(1021, 0, 0, 0, 0, 102, 100, 50, 60)  # 2.1 % and 2.0 %
    assert sizes.over_budget(budget, {configuration: larger}) == [
        f"{configuration.name}: text is 1021, its budget 1000"
    ]


def test_an_image_for_an_fpu_reports_the_fault_on_a_core_without_one() -> None:
    board = BOARDS["mps2-an386"]
    outcome = run(board, weak_image(board, "kapitza", "f32").image, PATIENCE_S, machine="mps2-an385")
    assert outcome.exit_code == 112
    with pytest.raises(PvidError, match="FPU instruction and no FPU, exception 0x00000003 pc 0x"):
        parse_report(outcome.text)
