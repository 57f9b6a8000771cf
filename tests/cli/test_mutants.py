"""Mutated rig files, runs and command lines: nothing but answers and sentences comes back."""

import os
from itertools import islice
from pathlib import Path
from random import Random

import pytest
from mutants import (
    Outcome,
    call,
    command_line,
    complaint,
    distorted_run,
    mutated_run,
    of_command_lines,
    of_rigs,
    of_runs,
    rig_text,
    written_subject,
)

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.base.toml_text import MOST_BYTES, toml_document
from pvid.cli.identify_run import recording_of
from pvid.rig import size as run_size
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import write_recording

MUTANTS = {"rigs": (of_rigs, 20), "runs": (of_runs, 8), "commands": (of_command_lines, 20)}


@pytest.mark.parametrize("kind", MUTANTS)
def test_mutants_get_answers_and_sentences_alone(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mutants, number = MUTANTS[kind]
    draw = Random(f"{kind} 7 0")
    subject = written_subject(draw.choice(KINDS), 7)
    codes = set()
    for arguments in islice(mutants(draw, subject), number):
        outcome = call(arguments)
        assert complaint(outcome) is None, arguments
        codes.add(outcome.code)
    assert codes >= {0, 2}  # some are answered, some are refused


def test_mutants_are_drawn_from_their_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    subject = written_subject("dc_motor", 1)
    for draw_one in (
        lambda draw: rig_text(draw, subject.model),
        command_line,
        lambda draw: distorted_run(subject.recording, draw),
        lambda draw: mutated_run(b"ab", draw),
    ):
        first, again, other = ([draw_one(draw) for _ in range(20)] for draw in map(Random, (1, 1, 2)))
        assert first == again != other


@pytest.mark.parametrize(
    ("outcome", "told"),
    [
        (Outcome(None, "", "", (), "Traceback\nValueError: x"), "ValueError: x"),
        (Outcome(0, "", "", ("overflow",), ""), "warning: overflow"),
        (Outcome(7, "", "", (), ""), "exit code 7"),
        (Outcome(2, "", "Usage: ...", (), ""), "a refusal without its sentence"),
        (Outcome(0, "g  nan", "", (), ""), "no number"),
        (Outcome(2, "", "pvid: no", (), ""), None),
        (Outcome(0, "g  9.8", "", (), ""), None),
    ],
)
def test_defects_are_classified(outcome: Outcome, told: str | None) -> None:
    found = complaint(outcome)
    assert found == told if told is None else told in str(found)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["log", "hwgrep://(", "x.pvlog"], "cannot open the port hwgrep"),
        (["log", "run.csv", "x.pvlog"], "run.csv"),
        (["log", "loop://", "x.pvlog", "--web", "a..b:80"], "is not a host's name"),
        (["log", "loop://", "x.pvlog", "--live", "udp://a..b:80"], "is not a host's name"),
        (["log", "loop://", "x.pvlog", "--live", "udp://[::1"], "is no address to send to"),
        (["tune", ""], "is a directory"),
        (["plot", "/dev/full", "--set", "known.l1=0.3"], "is not a regular file"),
        (["tables", "--form", "fir", "--points", "1000000000000001"], "no core takes more than 8191"),
        (["bench", "longevity", "--ticks", "0"], "--ticks"),
        (["identify", "run.csv", "--rig", "run.toml", "--figure", "x.pgf"], "must end in .png, .svg, .pdf"),
        (["identify", "run\x1b[31m\n.csv"], "run\\x1b[31m\\n.csv"),
    ],
)
def test_unknown_keys_are_refused_by_name(
    arguments: list[str], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    written_subject("dc_motor", 1)
    outcome = call(arguments)
    assert (outcome.code, complaint(outcome)) == (2, None)
    assert named in outcome.err


def test_names_are_shown_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "nonsense")
    name = "[red]$x$[x]漢\udcff.csv"
    told = call(["model", "simulate", "rigid_body", name, "--duration", "5"])
    assert (told.code, complaint(told)) == (0, None)
    assert "[red]$x$[x]漢\\udcff.csv: 5000 samples" in told.err
    drawn = call(["plot", name])
    assert (drawn.code, complaint(drawn)) == (0, None)
    assert "MPLBACKEND" not in os.environ


# ---- limits


def test_a_run_of_more_rows_than_fit_is_refused_in_every_format(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    subject = written_subject("dc_motor", 1)
    names = [tmp_path / f"run{suffix}" for suffix in (".csv", ".csv.gz", ".npz", ".parquet")]
    for path in names:
        write_recording(path, subject.recording, channels_of(subject.model))
    monkeypatch.setattr(run_size, "MOST_ROWS", 1000)
    for path in names:
        with pytest.raises(PvidError, match="more than 1000 rows of data, and no run is that long"):
            recording_of(path, MechanismRig("dc_motor"), None)
    monkeypatch.setattr(run_size, "BYTES_A_ROW", 1 << 40)
    with pytest.raises(PvidError, match="this machine has memory for no more"):
        recording_of(names[0], MechanismRig("dc_motor"), None)


def test_a_file_of_settings_is_short() -> None:
    for text, named in (("a" * (MOST_BYTES + 1), "longer than 64 kB"), (".".join("a" * 3000), "a line of more than")):
        with pytest.raises(PvidError, match=named):
            toml_document(text)
