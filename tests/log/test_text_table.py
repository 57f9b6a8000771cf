"""A board that prints lines of numbers is recorded as a table that identify reads; one that sends frames is not."""

import os
import pty
import random
import re
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from lying_board import LyingBoard
from pendulum_run import columns_of

from pvid.base.console import DIFFERENT, DONE
from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.log.reader import LogReader
from pvid.log.text_table import TextTable
from pvid.rig.run import read_recording

ROWS = "".join(f"{5 * k},{k % 255},{512 + k % 40},{3 * k}\r\n" for k in range(400))
HEADER = "t,duty,current,counts\r\n"


def table_of(text: str | bytes, piece: int = 7) -> tuple[TextTable, list[str]]:
    """A table that was fed in pieces, and its rows."""
    data, table = text.encode() if isinstance(text, str) else text, TextTable()
    rows = "".join(table.feed(data[k : k + piece]) for k in range(0, len(data), piece)) + table.end()
    return table, rows.splitlines()


def counts(table: TextTable) -> tuple[int, int, int, int]:
    return table.rows, table.damaged, table.words, table.restarts


@pytest.mark.parametrize("piece", [1, 7, 100_000])
def test_rows_have_the_names_of_the_header(piece: int) -> None:
    table, rows = table_of(HEADER + ROWS, piece)
    assert table.names == ("t", "duty", "current", "counts") and table.has_header and table.is_text
    assert counts(table) == (400, 0, 0, 0) and rows == ROWS.split()


def test_who_joins_late_loses_the_first_line_and_gets_numbered_columns() -> None:
    table, rows = table_of(ROWS[2:])
    assert table.names == ("column_1", "column_2", "column_3", "column_4") and not table.has_header
    assert rows == ROWS.split()[1:] and counts(table) == (399, 0, 0, 0)


def test_a_header_after_a_reset_names_the_columns() -> None:
    table, rows = table_of(ROWS[2:] + HEADER + ROWS)
    assert table.names == ("t", "duty", "current", "counts") and counts(table) == (799, 0, 0, 1)
    assert rows == ROWS.split()[1:] + ROWS.split()


def test_boot_text_damaged_lines_and_words_are_left_out_and_counted() -> None:
    boot = "ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\nready\r\n"
    lines = ROWS.splitlines(keepends=True)
    lines[100], lines[200], lines[300] = "500,100\r\n", "1000,2\ufffd,512,600\r\n", "calibrated\r\n"
    table, rows = table_of(boot + HEADER + "".join(lines))
    assert table.names == ("t", "duty", "current", "counts")
    assert (table.rows, table.damaged) == (397, 2) and table.words == 4
    assert len(rows) == 397 and "500,100" not in rows


@pytest.mark.parametrize(
    ("line", "cells"),
    [
        ("1;2,5;-3e-2", "1,2.5,-3e-2"),
        ("1\t2\t3", "1,2,3"),
        ("1 2.5  3", "1,2.5,3"),
        ("1, 2 ,3,", "1,2,3"),
        ("t:1,angle:2.5,duty:3", "1,2.5,3"),
        ("1,,3", "1,,3"),
    ],
)
def test_usual_ways_to_print_numbers(line: str, cells: str) -> None:
    table, rows = table_of(f"{line}\n" * 20)
    assert rows == [cells] * 19 and len(table.names) == 3
    assert (table.names == ("t", "angle", "duty")) == ("angle" in line)


def test_nothing_that_arrives_raises_or_fills_the_memory() -> None:
    noise = random.Random(1)
    table = TextTable()
    for _ in range(300):
        table.feed(noise.randbytes(noise.randrange(5000)))
        table.feed(bytes(noise.choices(b"0123456789,;.:\t\r\nab\xff-", k=2000)))
    table.feed(b"1" * 100_000)
    assert len(table._rest) <= 4096 and len(table._waiting) <= 21
    assert not table_of(b"".join(LyingBoard().introduction()))[0].is_text


def test_frames_are_seen() -> None:
    assert table_of(LyingBoard().honest())[0].frames > 10


# ---- through the command


@contextmanager
def board(say: Callable[[int], None]) -> Iterator[str]:
    """A pseudo-terminal on which `say` writes; its name."""
    here, there = pty.openpty()
    tty.setraw(there)
    thread = threading.Thread(target=say, args=(here,), daemon=True)
    thread.start()
    yield os.ttyname(there)
    os.close(there)
    thread.join(5)
    os.close(here)


def prints(text: str, pause: float = 0.0005) -> Callable[[int], None]:
    def say(port: int) -> None:
        for line in text.splitlines(keepends=True):
            try:
                os.write(port, line.encode())
            except OSError:
                return
            time.sleep(pause)

    return say


def log(*arguments: str | Path) -> Result:
    return CliRunner().invoke(commands, ["log", *map(str, arguments)], standalone_mode=False)


def test_what_a_board_prints_is_a_recording(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    with board(prints(HEADER + ROWS)) as port:
        found = log(port, out, "--samples", "400", "--duration", "20")
    assert found.return_value == DONE, found.output
    assert "400 rows of t, duty, current and counts" in found.output
    recording = read_recording(out, None, columns_of("t=t:ms,y=duty,phi=counts"))
    assert len(recording) == 400 and recording.sample_rate == pytest.approx(200.0)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]
    again = log(port, out)
    assert "run.csv exists: a recording replaces nothing" in str(again.exception)
    assert out.read_text().count("\n") == 401


def test_what_is_left_out_is_counted_and_all_bytes_are_kept(tmp_path: Path) -> None:
    lines = ROWS.splitlines(keepends=True)
    lines[50] = "250,50,5\r\n"
    out = tmp_path / "run.csv"
    with board(prints(HEADER + "".join(lines))) as port:
        found = log(port, out, "--samples", "399", "--duration", "20")
    assert found.return_value == DIFFERENT  # a loss of 0.25 %
    assert "1 damaged lines, 0 lines without numbers; all is in" in found.output
    assert (tmp_path / "run.csv.raw").read_bytes().startswith(HEADER.encode()) and "250,50,5\n" not in out.read_text()
    with board(prints(HEADER + "".join(lines))) as port:
        assert log(port, tmp_path / "b.csv", "--samples", "399", "--allow-loss", "0.01").return_value == DONE


def test_a_header_that_comes_late_is_written_in_front(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    with board(prints(ROWS + HEADER + ROWS)) as port:
        found = log(port, out, "--samples", "700", "--duration", "20")
    assert found.return_value == DONE and "was started again during the recording" in found.output
    assert out.read_text().startswith("t,duty,current,counts\n5,1,513,3\n")


def test_text_is_named_where_a_log_was_wanted(tmp_path: Path) -> None:
    with board(prints(HEADER + ROWS)) as port:
        found = log(port, tmp_path / "run.pvlog", "--duration", "10")
        sentence = str(found.exception)
        assert isinstance(found.exception, PvidError)
        assert re.search(r'sends text \("(\d+,\d+,\d+,\d+|t,duty,current,counts)"\), not frames', sentence), sentence
        assert f"pvid log {port} {tmp_path / 'run.csv'}" in sentence and not list(tmp_path.iterdir())


def test_frames_are_written_to_no_table(tmp_path: Path) -> None:
    frames = LyingBoard().honest()

    def say(port: int) -> None:
        for _ in range(20):
            try:
                os.write(port, frames)
            except OSError:
                return
            time.sleep(0.05)

    with board(say) as port:
        found = log(port, tmp_path / "run.csv", "--duration", "10")
        assert "sends frames, not text" in str(found.exception) and "run.pvlog` records them" in str(found.exception)
    assert not list(tmp_path.iterdir())
    for port, *more in (
        ("stream-host",),
        ("mps2-an386",),
        ("/dev/none", "--rig", "rig.toml"),
        ("/dev/none", "--append"),
    ):
        refused = log(port, tmp_path / "run.csv", *more)
        assert "is for frames, whose log is named" in str(refused.exception)
    assert "name it" in str(log("/dev/none", tmp_path / "run.npz").exception)
    assert not list(tmp_path.iterdir())


def test_boot_text_in_front_of_frames_is_no_table(tmp_path: Path) -> None:
    text = b"rst:0x1 (POWERON_RESET)\r\nload:0x3fff0030,len:1344\r\n" + b"1,2\r\n" * 5
    frames = LyingBoard().honest()

    def say(port: int) -> None:
        os.write(port, text)
        with pytest.raises(OSError):
            while True:
                os.write(port, frames)
                time.sleep(0.05)

    with board(say) as port:
        found = log(port, tmp_path / "run.pvlog", "--duration", "2", "--allow-loss", "1", "-q")
    assert found.exception is None, found.exception
    assert any(record for record in LogReader(tmp_path / "run.pvlog"))


def test_a_port_without_numbers_leaves_its_bytes_and_the_likely_cause(tmp_path: Path) -> None:
    with board(prints("hello\r\n" * 50)) as port:
        found = log(port, tmp_path / "run.csv", "--duration", "0.5")
    assert found.return_value == DIFFERENT and "not one line of numbers" in found.output
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv.raw"]
    missing = log("/dev/none", tmp_path / "new.csv")
    assert "there is no port" in str(missing.exception) and not (tmp_path / "new.csv").exists()
