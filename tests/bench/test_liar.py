"""A board that lies, in short form; `pvid bench liar` is the long one (liar.csv)."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.figures import sums_of
from bench.liar import COMMANDS, LATEST_S, MOST_KB, perform, rehearse
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


def test_the_table_of_results_has_no_defect() -> None:
    kept = sums_of("liar")
    assert kept["defects"] == 0 and kept["behaviours"] >= 100 and kept["mutants of frames"] >= 100_000
    assert kept["largest memory of the logger, kB"] < MOST_KB and kept["latest end of the logger, ms"] < 1000 * LATEST_S


@pytest.mark.parametrize("part", [0, 1, *(pytest.param(one, marks=pytest.mark.night) for one in (2, 3))])
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
