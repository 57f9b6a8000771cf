"""A board that lies: no lie ends a recording, breaks what looks on, or locks a log; nor does a mutant of a frame."""

import io
import json
import random
import struct
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from lies import BEHAVIOURS
from logs import log_of
from lying_board import LyingBoard, board, mechanism
from rehearsal import rehearse
from rich.console import Console

from pvid.link import frames as link
from pvid.log.file import LOG_SCHEMA
from pvid.log.live_stream import live_stream
from pvid.log.reader import LogReader, Observer
from pvid.log.status import StatusLine
from pvid.log.values import Values
from pvid.log.verify import Verifier
from pvid.show.page_state import LiveState
from pvid.show.view import LiveView

MUTANTS, A_LOG = 1500, 50
FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-45, 1e-38, 1e30, 3e38, float("inf"), float("-inf"), float("nan"))
WORDS = (0, 1, 2, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1)

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


@pytest.mark.parametrize("part", [0, 1, *(pytest.param(one, marks=pytest.mark.night) for one in (2, 3))])
def test_no_lie_ends_a_recording_or_what_looks_on(part: int, tmp_path: Path) -> None:
    """Every fourth behaviour: recorded with all views, exit code, what was honest read back."""
    behaviours = list(BEHAVIOURS.values())[part::4]
    faults = {one.name: rehearse(one, tmp_path, ()) for one in behaviours}
    assert {name: found for name, found in faults.items() if found} == {}


@pytest.mark.parametrize("name", READ_AGAIN)
def test_no_lie_locks_a_log(name: str, tmp_path: Path) -> None:
    assert rehearse(BEHAVIOURS[name], tmp_path, READ_AGAIN[name]) == []


# ---- frames of an honest board, changed at random and given a right CRC


def test_no_mutant_of_a_frame_breaks_what_reads_it(tmp_path: Path) -> None:
    """By every view, as numbers and by the twin; half of the mutants are of frames that are no samples."""
    chance = random.Random(1)
    frames = [item for item in link.Decoder().feed(LyingBoard().honest()) if isinstance(item, link.Frame)]
    kinds = [[one for one in frames if isinstance(one.message, link.Raw) == samples] for samples in (True, False)]
    for number in range(MUTANTS // A_LOG):
        sent = [link.encode(one.message, one.sequence, one.tick) for one in frames if number % 4 == 0]
        for _ in range(A_LOG):
            honest, other = (chance.choice(chance.choice(kinds)) for _ in range(2))
            sent += [link.encode(honest.message, honest.sequence, honest.tick), mutated(other, chance)]
        log = tmp_path / f"{number}.pvlog"
        log_of(log, b"".join(sent), rig=board().text())
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert list(faults_of(log)) == []


def mutated(frame: link.Frame, chance: random.Random) -> bytes:
    """Another frame: a field, the payload's length, or something of the header is not as it was."""
    number, payload, schema = frame.message.TYPE, bytearray(frame.message.payload), frame.schema
    tick, sequence = frame.tick & 0xFFFFFFFF, frame.sequence
    for _ in range(chance.randrange(1, 4)):
        match chance.randrange(8):
            case 0 | 1 | 2 if len(payload) >= 4:  # a word, where a field may be
                at = chance.randrange(0, len(payload) - 3)
                words = [struct.pack("<f", chance.choice(FLOATS)), struct.pack("<I", chance.choice(WORDS))]
                payload[at : at + 4] = chance.choice(words)
            case 3 if payload:
                payload[chance.randrange(len(payload))] = chance.randrange(256)
            case 4:
                cut = chance.randrange(len(payload) + 1)
                payload = payload[:cut] if chance.random() < 0.5 else payload + chance.randbytes(chance.randrange(40))
            case 5:
                number = chance.choice((*link.LAYOUTS, 240, 241, 242, 243, 244, chance.randrange(256)))
            case 6:
                tick = chance.choice((*WORDS, chance.randrange(1 << 32)))
            case _:
                sequence = chance.choice((0, sequence, chance.randrange(1 << 16)))
                schema = chance.choice((schema, schema, schema, LOG_SCHEMA, chance.randrange(1 << 32)))
    data = bytearray(link.encode_raw(number, sequence, tick, bytes(payload[: link.MAX_PAYLOAD]), schema))
    if chance.random() < 0.05:
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(data)


def faults_of(log: Path) -> Iterator[str]:
    """What goes wrong."""
    screen = io.StringIO()
    views: list[Observer] = [
        LiveView(Console(file=screen, force_terminal=True, width=100), "title", mechanism()),
        StatusLine(io.StringIO()),
        live_stream("udp://127.0.0.1:9", mechanism()),
    ]
    values, reader = Values(mechanism()), LogReader(log)
    try:
        for record in reader:
            for view in views:
                view.take(record, reader.account)
            for rows in values.rows(record):
                json.dumps({name: column.tolist() for name, column in rows.columns.items()})
        for view in views:
            view.idle(reader.account)
            view.close(reader.account)
        state = LiveState(log, "title")
        state.take(log.read_bytes())
        if "cannot be shown" in (shown := json.loads(state.as_json())["lost"]):
            yield f"page: {shown}"
        if reader.account.begun != 1:
            yield f"{reader.account.begun} segments"
        for stretch in Verifier(board()).stretches(LogReader(log)):
            if not stretch.text.isprintable():
                yield f"verify: {stretch.text!r}"
    except Exception:
        yield traceback.format_exc()
    if "\x1b]" in screen.getvalue() or "\x07" in screen.getvalue():
        yield "escapes on the terminal"
