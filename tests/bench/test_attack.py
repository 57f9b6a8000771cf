"""Mutated rig files, runs and command lines, in short form: nothing but answers and sentences comes back.

The long form is `pvid bench attack`; its figures are in attack.csv.
"""

from __future__ import annotations

import os
from pathlib import Path
from random import Random

import pytest

from bench.attack import (
    HEADER,
    KINDS,
    LONGEST_S,
    Outcome,
    attack,
    call,
    campaign,
    command_line,
    complaint,
    distorted_run,
    mutated_run,
    rig_text,
    written_subject,
)
from bench.figures import results_of
from pvid.base.errors import PvidError
from pvid.base.toml_text import MOST_BYTES, toml_document
from pvid.cli.identify_run import recording_of
from pvid.rig import size as run_size
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import write_recording

SHORT = {"rigs": 20, "runs": 8, "commands": 20}


@pytest.mark.parametrize("kind", KINDS)
def test_mutants_get_answers_and_sentences_alone(kind: str, tmp_path: Path) -> None:
    tally = attack(kind, SHORT[kind], 7, tmp_path)
    assert tally.defects == []
    assert tally.tried == SHORT[kind] == sum(tally.codes.values())
    assert tally.codes[2] > 0  # some are refused, and
    assert tally.codes[0] > 0  # some are answered


def test_the_table_of_results_counts_every_mutant() -> None:
    kept = results_of("attack")
    assert kept.header == HEADER and len(kept.rows) == len(KINDS)
    for _, mutants, _, answered, nothing, refused, defects, longest_s in kept.rows:
        assert int(answered) + int(nothing) + int(refused) == int(mutants) >= 500
        assert int(defects) == 0 and float(longest_s) < LONGEST_S


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


def test_a_campaign_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    done = tmp_path / "done"
    first = campaign(["commands"], 3, 5, 1, done=done)
    assert [one.tried for one in first] == [3] and len(done.read_text().splitlines()) == 1
    done.write_text(done.read_text().replace('"commands", 3, 5, 0', '"commands", 1000, 5, 0'))
    rest = campaign(["commands"], 1002, 5, 1, done=done)[0]
    assert rest.tried == 1002 and sum(rest.codes.values()) == 3 + 2  # the second chunk alone was run
    assert len(done.read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("outcome", "told"),
    [
        (Outcome(None, "", "", (), "Traceback\nValueError: x", 0.1), "ValueError: x"),
        (Outcome(0, "", "", ("overflow",), "", 0.1), "warning: overflow"),
        (Outcome(7, "", "", (), "", 0.1), "exit code 7"),
        (Outcome(2, "", "Usage: ...", (), "", 0.1), "a refusal without its sentence"),
        (Outcome(0, "g  nan", "", (), "", 0.1), "no number"),
        (Outcome(2, "", "pvid: no", (), "", 0.1), None),
        (Outcome(0, "g  9.8", "", (), "", 0.1), None),
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
        (["bench", "log", "--frames", "0"], "--frames"),
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
