"""The live view of a recording on a terminal, and what it remembers."""

import fcntl
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import field_board
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from logs import samples_in
from processes import PATIENCE_S, until
from rich.console import Console

from pvid.base.rounding import with_error, with_prefix
from pvid.core.native import Native
from pvid.link import frames as link
from pvid.log.history import History, Thinned, envelope
from pvid.log.mechanism import UNNAMED, LogMechanism
from pvid.log.reader import Account, LogReader, LogStream, Record
from pvid.log.values import Rows, Values
from pvid.log.words import kappa_share, kappa_words, reason_words
from pvid.settings.enums import Reason
from pvid.show.view import LiveView, sparkline

TICKS = 12_000
MECHANISM = field_board.mechanism()


@pytest.fixture(scope="module")
def sent() -> list[bytes]:
    """The frames of a run of TICKS with ten estimates a second."""
    return list(field_board.frames(field_board.messages(field_board.Field(TICKS, estimate_every=100))))


def view_of(frames: list[bytes], mechanism: LogMechanism = MECHANISM, width: int = 100) -> str:
    """What is seen after these frames."""
    console = Console(width=width, force_terminal=True, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    view = LiveView(console, "a port -> a [bold]log", mechanism)
    stream = LogStream()
    for record in stream.feed(b"".join(frames)):
        view.take(record, stream.account)
    console.print(view.panel(stream.account, time.monotonic() + 1))
    return console.export_text()


# ---- the picture


def test_view_shows_every_item(sent: list[bytes]) -> None:
    seen = view_of(sent)
    values, newest = Values(MECHANISM), {}
    stream = LogStream()
    for record in stream.feed(b"".join(sent)):
        for rows in values.rows(record):
            if rows.table == "estimates":
                newest = {name: column[0] for name, column in rows.columns.items()}
    for name in ("g", "l2", "rho2", "w", "d1", "d2", "c"):
        shown, spread = with_error(newest[name], newest[f"{name}_se"])
        assert f"{shown}  ± {spread}" in seen
    assert "field: kapitza, float32, 1000 samples per second" in seen
    assert f"{TICKS} samples" in seen and "lost       nothing" in seen
    assert f"{newest['kappa']:.2g}  good" in seen and "times the noise of the sensors" in seen
    assert "updated" in seen and "the estimate was updated" in seen
    assert "a port -> a [bold]log" in seen
    assert " rad, y " in seen or " mm, phi " in seen


def test_losses_and_a_broken_link_are_reported(sent: list[bytes]) -> None:
    without = [frame for i, frame in enumerate(sent) if not 100 <= i < 105]
    seen = view_of(without)
    assert "5 frames" in seen and "samples" in seen.split("lost")[1].splitlines()[0]


def test_view_before_the_first_frame_is_labelled(sent: list[bytes]) -> None:
    assert "has not described itself yet" in view_of([])
    beginning = view_of(sent[:5])
    assert "none yet" in beginning and "no estimate yet" in beginning


def test_without_the_rods_length_there_are_no_outputs(sent: list[bytes]) -> None:
    seen = view_of(sent, mechanism=UNNAMED)
    assert "rho2" not in seen and "d2" in seen


def test_estimate_outside_the_physical_region_is_reported(sent: list[bytes]) -> None:
    decoder, frames = link.Decoder(), []
    for item in decoder.feed(b"".join(sent)):
        assert isinstance(item, link.Frame)
        wild = item.message
        if isinstance(wild, link.Estimate):
            wild = replace(wild, p=(11.56, 0.25, 0.2, *[0.0] * 5))
        frames.append(link.encode(wild, item.sequence, item.tick))
    seen = view_of(frames)
    assert "g, l2, rho2" in seen and "outside the physical region" in seen
    assert "outside" not in view_of(frames, mechanism=UNNAMED)


def test_board_name_is_escaped(native: Native) -> None:
    frames: list[bytes] = []
    for tick, message in field_board.messages(field_board.Field(32)):
        told = replace(message, board="[/bold][red]x") if isinstance(message, link.Hello) else message
        frames.append(link.encode(told, len(frames), tick))
    assert "[/bold][red]x" in view_of(frames)


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_the_view_fits_the_terminal(sent: list[bytes], width: int) -> None:
    assert max(map(len, view_of(sent, width=width).splitlines())) <= min(width, 110)


def test_every_reason_has_words() -> None:
    assert all(reason_words(one.text) for one in Reason)
    assert reason_words("of another version") == ""


def test_kappa_in_words_and_as_a_bar() -> None:
    assert [kappa_words(one) for one in (0.0, 1e-4, 2e-3, 0.01)] == [
        "parameters not identifiable",
        "weak: parameters barely identifiable",
        "fair: parameters identifiable",
        "good: parameters identifiable",
    ]
    assert [kappa_share(one) for one in (0.0, 1e-7, 1e-3, 1.0, 7.0, float("nan"))] == [0, 0, 0.5, 1, 1, 0]


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        (9.50069, 0.00113, ("9.5007", "0.0011")),
        (31.669, 2.4, ("31.7", "2.4")),
        (120.0, 35.0, ("120", "35")),
        (-2.1e-6, 1.24e-6, ("-2.1e-06", "1.2e-06")),
        (1.0, 0.0, ("1", "0")),
        (1.0, float("nan"), ("1", "nan")),
    ],
)
def test_value_is_rounded_to_the_second_digit_of_its_error(value: float, error: float, told: tuple[str, str]) -> None:
    assert with_error(value, error) == told


@pytest.mark.parametrize(
    ("value", "error", "unit", "told"),
    [
        (0.0030002, 8e-7, "H", ("3.00020", "0.00080", "mH", 1e-3)),
        (-0.3, 0.01, "N", ("-300", "10", "mN", 1e-3)),
        (47000.0, 120.0, "ohm", ("47.00", "0.12", "kohm", 1e3)),
        (0.05, 4.6e-7, "N*m/A", ("0.05000000", "0.00000046", "N*m/A", 1.0)),
        (3.7, 9.7e-6, "V", ("3.7000000", "0.0000097", "V", 1.0)),
        (2e-4, 3.5e-9, "kg*m^2", ("2.000000e-04", "3.5e-09", "kg*m^2", 1.0)),
        (0.0, 0.002, "m", ("0.0000", "0.0020", "m", 1.0)),
        (3e12, 1e10, "Hz", ("3000000", "10000", "MHz", 1e6)),
    ],
)
def test_a_prefix_brings_a_value_to_1_or_above(
    value: float, error: float, unit: str, told: tuple[str, str, str, float]
) -> None:
    assert with_prefix(value, error, unit) == told


def test_a_sparkline_has_its_median_at_half_height() -> None:
    assert sparkline(np.array([0.0, 1, 1, 2, 50, np.nan]), 10) == "▁▅▅██ "
    assert sparkline(np.array([]), 10) == sparkline(np.array([np.nan]), 10) == ""
    assert len(sparkline(np.ones(99), 10)) == 10


# ---- what it remembers


@given(st.integers(1, 50), st.integers(0, 3000))
def test_a_thinned_history_is_even_bounded_and_has_the_newest(points: int, count: int) -> None:
    thinned: Thinned[tuple[float, ...]] = Thinned(points)
    for i in range(count):
        thinned.append((float(i),))
        assert len(thinned.rows) <= 2 * points
    kept = [int(row[0]) for row in thinned.rows]
    assert (kept[-1:] == [count - 1]) if count else not kept
    even = kept[:-1]
    assert all(b - a == even[1] - even[0] for a, b in zip(even, even[1:], strict=False))
    assert len(kept) >= min(count, points)


def test_an_envelope_keeps_the_extremes_where_they_are() -> None:
    t = np.arange(10_007) / 1000
    x = np.sin(7 * t)
    x[4321] = 9
    x[77] = -9
    chosen_t, chosen_x = envelope(t, x, 100)
    assert len(chosen_t) == 200 and (np.diff(chosen_t) >= 0).all()
    assert chosen_x.max() == 9 and chosen_t[chosen_x.argmax()] == t[4321] and chosen_x.min() == -9
    same = envelope(t[:200], x[:200], 100)
    assert np.array_equal(same[0], t[:200]) and np.array_equal(same[1], x[:200])


def test_the_history_is_that_of_the_log_in_bounded_memory(sent: list[bytes], tmp_path: Path) -> None:
    history, whole = History(MECHANISM, points=20, window_s=3.0), History(MECHANISM, points=1000, window_s=100.0)
    stream = LogStream()
    for record in stream.feed(b"".join(sent)):
        history.take(record)
        whole.take(record)
    t, y, phi = whole.samples()
    run = field_board.Field(TICKS).run
    assert np.array_equal(phi, run.phi[:TICKS].astype(np.float32)) and np.array_equal(y, run.y[:TICKS].astype("f4"))
    assert t == pytest.approx(np.arange(TICKS) / 1000, abs=2e-9)
    assert history.samples() == pytest.approx(np.stack([t, y, phi])[:, -3000:])
    assert len(whole.estimates("t")) == TICKS // 100 and len(history.estimates("t")) <= 40
    late = whole.estimates("t") - np.arange(100, TICKS + 1, 100) / 1000
    assert (late > -2e-9).all() and (late < field_board.SAMPLES_A_FRAME / 1000).all()  # log_time never goes back
    for name in history.numbers:
        assert set(history.estimates(name)) <= set(whole.estimates(name))
        assert history.newest[name] == whole.estimates(name)[-1]


def test_the_view_costs_the_same_however_many_frames_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted in calls that turn records into numbers, between two pictures: a hundred times the frames are as many."""
    rows, calls = Values.rows, 0

    def counted(values: Values, record: Record) -> Iterator[Rows]:
        nonlocal calls
        calls += 1
        return rows(values, record)

    monkeypatch.setattr(Values, "rows", counted)
    points, n = 50, field_board.SAMPLES_A_FRAME
    estimate = link.Estimate(7, 1, (31.0, 9.0, 5.0, *[0.0] * 5), (1e-6,) * 36, 0.01, 1e-4, 1.0, 0)
    spent = []
    for frames in (200, 20_000):
        history = History(MECHANISM, points=points)
        calls = 0
        for i in range(frames):
            history.take(Record(0, 1, n * i, link.Raw.of_values(np.full(n, i), np.zeros(n))))
            history.take(Record(0, 1, n * (i + 1), replace(estimate, updates=i)))
        assert history.newest["w"] == 31.0 and history.samples()[2, -1] == frames - 1
        assert len(history.estimates("w")) >= points
        spent.append(calls)
        history.reason  # noqa: B018 - looking once more costs nothing
        assert calls == spent[-1]
    # of each kept estimate one, and one of the samples before it; as often as more is put aside than may be
    assert spent[0] <= 2 * 2 * points and spent[1] <= 3 * 2 * 2 * points


def test_a_flood_is_drawn_as_what_comes_slowly(sent: list[bytes]) -> None:
    """The same history, whether somebody looks after every record or only at the end."""
    often, seldom, stream = History(MECHANISM, points=20), History(MECHANISM, points=20), LogStream()
    for record in stream.feed(b"".join(sent)):
        often.take(record)
        often.samples()
        seldom.take(record)
    assert often.newest == seldom.newest and often.reason == seldom.reason
    assert np.array_equal(often.samples(), seldom.samples())
    for name in ("t", *often.numbers):
        assert np.array_equal(often.estimates(name), seldom.estimates(name), equal_nan=True)


# ---- the program


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Path]:
    """A board that sends TICKS behind a symbolic link."""
    place = tmp_path / "board"
    playing = field_board.Board(place, TICKS)
    yield place
    playing.kill()


class Terminal:
    """`pvid log` of the board on a pseudo-terminal of 100 columns."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 100, 0, 0))
        command = [sys.executable, "-m", "pvid", "log", "board", "out.pvlog", *arguments]
        environment = {**os.environ, "TERM": "xterm-256color"}
        self.process = subprocess.Popen(command, cwd=folder, stdout=theirs, stderr=theirs, env=environment)
        os.close(theirs)

    def read_to_end(self) -> str:
        """All that the terminal got, once the program has ended."""
        got = b""
        try:
            while data := os.read(self.ours, 1 << 16):
                got += data
        except OSError:
            pass  # the other end is closed
        self.process.wait(timeout=PATIENCE_S)
        os.close(self.ours)
        return got.decode()


def test_log_draws_on_a_terminal_and_leaves_the_last_picture(tmp_path: Path, board: Path) -> None:
    terminal = Terminal(tmp_path, "--duration", "4")
    seen = terminal.read_to_end()
    assert terminal.process.returncode == 0, seen
    assert "has not described itself yet" in seen or "samples per second" in seen
    last = seen[seen.rindex("╭") :]
    assert "d2 " in last and f"{samples_in(tmp_path / 'out.pvlog')} samples in 1 segment" in last
    assert last.count("ended") >= 1 and "Ctrl-C ends" not in last


def test_blocked_terminal_does_not_delay_the_log(tmp_path: Path, board: Path) -> None:
    terminal = Terminal(tmp_path)
    until(lambda: samples_in(tmp_path / "out.pvlog") >= TICKS)
    terminal.process.send_signal(signal.SIGINT)
    seen = terminal.read_to_end()
    assert terminal.process.returncode == 0, seen
    reader = LogReader(tmp_path / "out.pvlog")
    records: list[Record] = list(reader)
    account: Account = reader.account
    assert records and account.samples == TICKS and account.lost_share == 0


def test_quiet_is_quiet(tmp_path: Path, board: Path) -> None:
    terminal = Terminal(tmp_path, "--quiet", "--duration", "1")
    seen = terminal.read_to_end()
    assert terminal.process.returncode == 0, seen
    assert "\x1b[" not in seen and seen.startswith("segment 0, board: ")
