"""The weak form of a mechanism on emulated boards, in either arithmetic: the hash that the twin predicts."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from program import pvid

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.board import mechanism_image_q31
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import MISSING, build_mechanism_image, header, mechanism_run, native_hashes, twin_hashes
from pvid.board.replay_image import REPORT_EVERY, play

TIMEOUT_S = 300.0
TICKS = 2500


def _long(board: str, name: str, core: str) -> Any:
    return pytest.param(board, name, core, marks=pytest.mark.long)


@pytest.mark.parametrize(
    ("board", "name", "core"),
    [
        ("mps2-an386", "cart_pendulum", "f32"),
        ("virt-rv32imac", "battery_2rc", "q31"),  # the pendulum: test_targets.py
        ("microbit", "dc_motor", "q31"),  # its short products have less room than those of other cores
        _long("virt-rv32imac", "battery_2rc", "f32"),
        *(_long(board, "two_link_arm", "f32") for board in ("mps3-an547", "virt-rv32imafc")),
        *(_long("mps2-an386", name, "f32") for name in KINDS if name != "cart_pendulum"),
        *(_long("mps2-an386", name, "q31") for name in KINDS),
    ],
)
def test_a_board_computes_the_bits_of_the_twin(board: str, name: str, core: str) -> None:
    if core == "f32":
        run = mechanism_run(name)
        expected, native = twin_hashes(run), native_hashes(run)
        image, _ = build_mechanism_image(BOARDS[board], run)
    else:
        fixed = mechanism_image_q31.fixed_run(name)
        expected, native = mechanism_image_q31.twin_hashes(fixed), mechanism_image_q31.native_hashes(fixed)
        image, _ = mechanism_image_q31.build_fixed_image(BOARDS[board], fixed)
    report = play(BOARDS[board], image, TIMEOUT_S)
    assert report.ticks == len(expected)
    assert {at: int(expected[at - 1]) for at in report.hashes} == report.hashes
    assert len(report.hashes) == len(expected) // REPORT_EVERY
    assert report.hash == int(expected[-1]) == int(native[-1])
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
