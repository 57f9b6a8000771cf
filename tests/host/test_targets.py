"""The core on every board: built by its cross compiler, run in its emulator, the bits of the host and the twin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pvid.boards import BOARDS, BUILD, Board, build, run
from pvid.errors import PvidError
from pvid.native import Native
from pvid.replay_image import ReplayReport, ReplayRun, header, native_hashes, parse_report, standard_run, twin_hashes

TICKS = 5000
LONG_TICKS = 40_000
LONG = ("mps2-an386", "virt-rv32imac")

# A stuck emulator ends here; the slowest run, soft float on the Cortex-M0, takes some 10 s alone on the machine.
TIMEOUT_S = 300


def write_if_changed(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def image(board: Board, replay: ReplayRun) -> Path:
    name = f"{replay.form}-{replay.ticks}"
    write_if_changed(BUILD / "runs" / name / "replay_run.h", header(replay))
    options = {"PVID_REPLAY_RUN": str(BUILD / "runs" / name)}
    if replay.form == "strong":
        options["PVID_MAX_WINDOW"] = "5"
    return build(board, BUILD / f"{board.name}-{name}", options) / "apps" / "replay" / "replay.elf"


def play(board: Board, replay: ReplayRun) -> ReplayReport:
    outcome = run(board, image(board, replay), TIMEOUT_S)
    assert outcome.exit_code == 0, outcome.text
    return parse_report(outcome.text)


EMULATED = [board for board in BOARDS.values() if board.toolchain != "avr"]


@pytest.mark.parametrize("form", ["strong", "weak"])
@pytest.mark.parametrize("board", EMULATED, ids=lambda board: board.name)
def test_a_board_computes_the_bits_of_the_host_and_of_the_twin(board: Board, form: str, native: Native) -> None:
    replay = standard_run(form, LONG_TICKS if board.name in LONG else TICKS)
    expected = native_hashes(replay, native)
    report = play(board, replay)
    assert report.ticks == replay.ticks
    assert report.hashes == {tick: int(expected[tick - 1]) for tick in report.hashes}
    assert len(report.hashes) == replay.ticks // 500
    assert report.hash == int(expected[-1])
    assert 0 < report.stack_used < report.stack_size


@pytest.mark.parametrize("form", ["strong", "weak"])
def test_the_host_computes_the_bits_of_the_twin(form: str, native: Native) -> None:
    replay = standard_run(form, LONG_TICKS)
    assert np.array_equal(native_hashes(replay, native), twin_hashes(replay))


def test_an_image_for_an_fpu_reports_the_fault_on_a_core_without_one() -> None:
    board = BOARDS["mps2-an386"]
    outcome = run(board, image(board, standard_run("weak", LONG_TICKS)), TIMEOUT_S, machine="mps2-an385")
    assert outcome.exit_code == 112
    with pytest.raises(PvidError, match="FPU instruction and no FPU, exception 0x00000003 pc 0x"):
        parse_report(outcome.text)
