"""A board that lies, in short form; `pvid bench liar` is the long one (tests/LIAR.md)."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.liar import COMMANDS, HEADER, perform, rehearse
from bench.liar_mutants import mutate
from bench.lies import BEHAVIOURS

MUTANTS = 1500
# What a command once failed on, and the command.
READ_AGAIN = {
    "nothing but the truth": ("verify",),
    "laws that there are not": ("verify",),
    "row sd that is none": ("verify", "identify", "export csv"),
    "samples that are no numbers": ("identify", "export npz"),
    "samples that are all zero": ("plot",),
    "units that are none in fixed point": ("export parquet", "export mcap", "identify"),
    "sample rates that are none": ("export csv", "identify"),
}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A link is taken up again, and the log looked at, without delay."""
    monkeypatch.setattr("pvid.log.recorder._RETRY_S", 0.01)
    monkeypatch.setattr("pvid.log.recorder._LOOK_S", 0.005)


def test_number_of_behaviours() -> None:
    assert len(BEHAVIOURS) >= 100


def test_summary_of_the_page_is_that_of_its_table() -> None:
    """The same number of behaviours, no defect, the largest memory and delay."""
    text = (Path(__file__).parents[1] / "LIAR.md").read_text()
    lines = text.partition("<!-- liar -->")[2].partition("<!-- /liar -->")[0].strip().splitlines()
    assert tuple(cell.strip() for cell in lines[0].strip("|").split("|")) == HEADER
    rows = [dict(zip(HEADER, (cell.strip() for cell in line.strip("|").split("|")), strict=True)) for line in lines[2:]]
    names = [row[HEADER[0]] for row in rows]
    assert len(names) >= 100 and names == [name for name in BEHAVIOURS if name in names]
    assert {row["defects"] for row in rows} == {"0"}
    memory, late = (max(float(row[key]) for row in rows) for key in ("peak memory, MB", "late, s"))
    summary = text.partition("<!-- liar-summary -->")[2]
    assert f"{len(names)} behaviours, " in summary and ": 0 defects" in summary
    assert f"at most {memory:.0f} MB of memory, at most {late:.1f} s late." in summary
    assert memory < 150 and late < 8


@pytest.mark.parametrize("part", range(4))
def test_no_lie_ends_a_recording_or_what_looks_on(part: int, tmp_path: Path) -> None:
    """Every fourth behaviour: recorded with all views, exit code, what was honest read back."""
    behaviours = list(BEHAVIOURS.values())[part::4]
    faults = {one.name: rehearse(one, tmp_path, ()) for one in behaviours}
    assert {name: found for name, found in faults.items() if found} == {}


@pytest.mark.parametrize("name", READ_AGAIN)
def test_no_lie_locks_a_log(name: str, tmp_path: Path) -> None:
    assert rehearse(BEHAVIOURS[name], tmp_path, READ_AGAIN[name]) == []


def test_no_mutant_of_a_frame_breaks_what_reads_it(tmp_path: Path) -> None:
    tally = mutate(MUTANTS, tmp_path)
    assert (tally.mutants, tally.faults) == (MUTANTS, [])


def test_the_program_withstands_a_liar_on_a_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The long form's way, for one behaviour and one command."""
    monkeypatch.setattr("bench.liar.COMMANDS", COMMANDS[:1])
    monkeypatch.setattr("bench.liar.DURATION_S", 1.0)
    done = perform(BEHAVIOURS["schemas without end"], tmp_path)
    assert done.faults == []
    assert 0 < done.peak_kb < 150 * 1024
