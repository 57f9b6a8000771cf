"""The weak form with the generated C of a mechanism on emulated boards: the hash that the twin predicts."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import MISSING, build_mechanism_image, header, mechanism_run, native_hashes, twin_hashes
from pvid.board.replay_image import REPORT_EVERY, play
from pvid.models import mechanisms

TIMEOUT_S = 120.0
TICKS = 2500


@pytest.mark.parametrize(
    ("board", "name"),
    [
        ("mps2-an386", "cart_pendulum"),
        pytest.param("virt-rv32imac", "battery_2rc", marks=pytest.mark.long),
        *(pytest.param("mps2-an386", name, marks=pytest.mark.long) for name in mechanisms.names()),
        *(pytest.param(board, "two_link_arm", marks=pytest.mark.long) for board in ("mps3-an547", "virt-rv32imafc")),
    ],
)
def test_a_board_computes_the_bits_of_the_twin(board: str, name: str) -> None:
    run = mechanism_run(name)
    expected = twin_hashes(run)
    image, _ = build_mechanism_image(BOARDS[board], run)
    report = play(BOARDS[board], image, TIMEOUT_S)
    assert report.ticks == len(run.counts)
    assert {at: int(expected[at - 1]) for at in report.hashes} == report.hashes
    assert len(report.hashes) == len(run.counts) // REPORT_EVERY
    assert report.hash == int(expected[-1]) == int(native_hashes(run)[-1])
    assert report.instructions_mean > 0


def test_an_avr_is_refused_in_words() -> None:
    with pytest.raises(PvidError, match="float32 has no bits of the twin on an AVR"):
        build_mechanism_image(BOARDS["atmega2560"], mechanism_run("kapitza", TICKS))


def test_a_sample_is_a_count_times_its_resolution() -> None:
    run = mechanism_run("kapitza", TICKS)
    assert (run.counts != MISSING).all()
    text = header(run)
    rows = re.findall(r"^    \{(-?\d+), (-?\d+)\},$", text, re.MULTILINE)
    assert len(rows) == TICKS
    assert [int(one) for one in rows[7]] == run.counts[7].tolist()


def test_sizes_of_a_mechanism_are_written_as_json(tmp_path: Path) -> None:
    outcome = pvid(tmp_path, "sizes", "--json", "mps2-an386", "--model", "cart_pendulum")
    assert outcome.returncode == 0, outcome.stderr
    (found,) = json.loads(outcome.stdout)
    assert {key: found[key] for key in ("target", "model", "form", "core")} == {
        "target": "mps2-an386",
        "model": "cart_pendulum",
        "form": "weak",
        "core": "f32",
    }
    assert all(found[key] > 0 for key in ("text", "tables", "state", "stack_bound", "mean", "longest"))
    assert found["longest"] >= found["mean"]
