"""Frames of an honest board, changed at random and given a right CRC, against all that reads a log."""

from __future__ import annotations

import io
import json
import random
import struct
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from bench.liar_board import LyingBoard, board, mechanism
from pvid.link import frames as link
from pvid.link.frames import LAYOUTS, MAX_PAYLOAD, Frame
from pvid.log.file import LOG_SCHEMA, LogWriter
from pvid.log.live_stream import live_stream
from pvid.log.reader import LogReader, Observer
from pvid.log.status import StatusLine
from pvid.log.values import Values
from pvid.log.verify import Verifier
from pvid.show.page_state import LiveState
from pvid.show.view import LiveView

A_LOG = 50  # mutants
_FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-45, 1e-38, 1e30, 3e38, float("inf"), float("-inf"), float("nan"))
_WORDS = (0, 1, 2, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1)


@dataclass
class Tally:
    """Of mutants: how many were read, in how many logs, and what went wrong, a sentence each."""

    mutants: int = 0
    logs: int = 0
    faults: list[str] = field(default_factory=list)


def _mutated(frame: Frame, chance: random.Random) -> bytes:
    """Another frame: a field, the payload's length, or something of the header is not as it was."""
    number, payload, schema = frame.message.TYPE, bytearray(frame.message.payload), frame.schema
    tick, sequence = frame.tick & 0xFFFFFFFF, frame.sequence
    for _ in range(chance.randrange(1, 4)):
        match chance.randrange(8):
            case 0 | 1 | 2 if len(payload) >= 4:  # a word, where a field may be
                at = chance.randrange(0, len(payload) - 3)
                words = [struct.pack("<f", chance.choice(_FLOATS)), struct.pack("<I", chance.choice(_WORDS))]
                payload[at : at + 4] = chance.choice(words)
            case 3 if payload:
                payload[chance.randrange(len(payload))] = chance.randrange(256)
            case 4:
                cut = chance.randrange(len(payload) + 1)
                payload = payload[:cut] if chance.random() < 0.5 else payload + chance.randbytes(chance.randrange(40))
            case 5:
                number = chance.choice((*LAYOUTS, 240, 241, 242, 243, 244, chance.randrange(256)))
            case 6:
                tick = chance.choice((*_WORDS, chance.randrange(1 << 32)))
            case _:
                sequence = chance.choice((0, sequence, chance.randrange(1 << 16)))
                schema = chance.choice((schema, schema, schema, LOG_SCHEMA, chance.randrange(1 << 32)))
    data = bytearray(link.encode_raw(number, sequence, tick, bytes(payload[:MAX_PAYLOAD]), schema))
    if chance.random() < 0.05:
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(data)


def _log_of(frames: list[Frame], chance: random.Random) -> bytes:
    """What a board sends: A_LOG mutants, each behind an honest frame; one log of four begins with the whole run in its
    order, in which mutants of what is no sample stand for it or beside it."""
    sent = []
    left = A_LOG
    if chance.random() < 0.25:
        for frame in frames:
            if not isinstance(frame.message, link.Raw) and chance.random() < 0.5:
                sent.append(_mutated(frame, chance))
                left -= 1
                if chance.random() < 0.5:
                    continue
            sent.append(_encoded(frame))
    for _ in range(left):
        sent += [_encoded(_any(frames, chance)), _mutated(_any(frames, chance), chance)]
    return b"".join(sent)


def _encoded(frame: Frame) -> bytes:
    return link.encode(frame.message, frame.sequence, frame.tick)


def _any(frames: list[Frame], chance: random.Random) -> Frame:
    """One of them; samples, of which there are many, no more often than all others together."""
    samples = chance.random() < 0.5
    return chance.choice([frame for frame in frames if isinstance(frame.message, link.Raw) == samples])


def mutate(count: int, folder: Path, seed: int = 1, progress: Callable[[int], None] | None = None) -> Tally:
    """Writes logs with `count` mutants in all; reads each by every view, as numbers and by the twin."""
    chance = random.Random(seed)
    decoded = link.Decoder().feed(LyingBoard().honest())
    frames = [item for item in decoded if isinstance(item, Frame)]
    tally = Tally()
    while tally.mutants < count:
        log = folder / "mutants.pvlog"
        log.unlink(missing_ok=True)
        writer = LogWriter(log, rig=board().text())
        writer.begin("a port", None)
        writer.take(_log_of(frames, chance))
        writer.end("the end")
        writer.close()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            tally.faults += [f"log {tally.logs}, {one}" for one in _read(log)]
        tally.mutants += A_LOG
        tally.logs += 1
        if progress is not None:
            progress(tally.mutants)
    return tally


def _read(log: Path) -> Iterator[str]:
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
