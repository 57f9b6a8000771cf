"""Cycles of a real core: what the bench reads and prints. The core itself takes minutes: the bench alone plays it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.cycles import CLOCKS_MHZ, HEADER, row_of, rtl, same_bits, share
from bench.figures import results_of
from pvid.board.replay_image import ReplayReport

HASHES = np.arange(7, 1007, dtype=np.uint32)
REPORT = ReplayReport(
    ticks=1000,
    hash=1006,
    hashes={500: 506, 1000: 1006},
    instructions_mean=199.7,
    instructions_longest=780.0,
    stack_used=600,
    stack_size=16384,
    state_bytes=4536,
    estimator_bytes=632,
)


def test_every_reported_hash_has_to_be_that_of_this_machine() -> None:
    assert same_bits(REPORT, HASHES)
    assert not same_bits(replace(REPORT, hash=1), HASHES)
    assert not same_bits(replace(REPORT, hashes={500: 505}), HASHES)
    assert not same_bits(REPORT, HASHES[:-1])


def test_a_row_has_the_shares_of_its_mean() -> None:
    row = row_of("weak", "none", REPORT, True)
    assert row == ("weak", "none", "1000", "200", "780", "1.25", "0.42", "0.20", "equal")
    assert row_of("weak", "none", REPORT, False)[-1] == "DIFFERENT"


def test_the_core_comes_without_its_models_of_cells(tmp_path: Path) -> None:
    manifest = (
        "// Manifest\n+incdir+${DESIGN_RTL_DIR}/include\n\n${DESIGN_RTL_DIR}/a.sv\n${DESIGN_RTL_DIR}/../bhv/gate.sv\n"
    )
    (tmp_path / "cv32e40p_fpu_manifest.flist").write_text(manifest, encoding="utf-8")
    folder = tmp_path / "rtl"
    assert rtl(folder) == [f"+incdir+{folder}/include", f"{folder}/a.sv"]


def test_the_shares_of_the_table_follow_from_its_cycles() -> None:
    kept = results_of("cycles")
    assert kept.header == HEADER and len(kept.rows) == 5
    for _, _, ticks, mean, longest, *shares, bits in kept.rows:
        assert bits == "equal" and 0 < int(mean) <= int(longest) and int(ticks) >= 1000
        assert [float(one) for one in shares] == [pytest.approx(share(int(mean), mhz), abs=0.006) for mhz in CLOCKS_MHZ]


def test_stages_of_the_fpu_cost_cycles() -> None:
    mean = {(title, fpu): int(cycles) for title, fpu, _, cycles, *_ in results_of("cycles").rows}
    slower = [title for title, fpu in mean if fpu == "latency 2"]
    assert len(slower) == 2 and all(mean[one, "latency 2"] > mean[one, "latency 0"] for one in slower)
