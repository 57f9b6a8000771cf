"""Field mode: a board samples by itself, and the PC collects its frames.

    with open_target("mps2-an386", rig) as target:
        record = collect(target, 5000, begin=rig)      # starts the board over; without begin: joins in
    y, phi = record.samples(0, 5000)                   # exactly the identifier's input, in its order

link.py describes the frames. The image's settings, the configuration and every sample from the session's first tick on
are enough to compute every bit again.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.stream_image import Streamed, settings_number
from pvid.board.target import Target, refusal
from pvid.link.frames import (
    Code,
    Configuration,
    Counters,
    Decoder,
    Estimate,
    EstimateQ31,
    Frame,
    Hash,
    Hello,
    Message,
    Raw,
    RawCount,
    RefinedEstimate,
    Schema,
    Source,
    Status,
    encode,
)

Samples = npt.NDArray[Any]  # [ticks, samples]: float32, or int32 counts

RESEND_S = 1.0  # without an answer a Configure is sent again


@dataclass
class FieldRecord:
    """What a board in field mode said in one session, by ticks done.

    `raw` are the samples as they came, by the tick of their first one; `ticks` is one more than the last sample's.
    """

    hello: Hello | None = None
    schema: str | None = None
    configuration: Configuration | None = None
    status: Status | None = None
    raw: dict[int, Samples] = field(default_factory=dict)
    hashes: dict[int, int] = field(default_factory=dict)
    estimates: dict[int, Estimate | EstimateQ31] = field(default_factory=dict)
    refined: dict[int, RefinedEstimate] = field(default_factory=dict)
    received: Counters = field(default_factory=Counters)

    @property
    def ticks(self) -> int:
        """One more than the last sample's tick; 0: none has come."""
        return max((first + len(part) for first, part in self.raw.items()), default=0)

    @property
    def first(self) -> int:
        """Tick of the first sample that came."""
        return min(self.raw, default=0)

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """Samples that are missing between the first and the last: (first, one past the last) of each gap."""
        found = []
        at = self.first
        for first in sorted(self.raw):
            if first > at:
                found.append((at, first))
            at = max(at, first + len(self.raw[first]))
        return found

    def samples(self, begin: int, end: int) -> tuple[Samples, ...]:
        """Each sample of ticks begin..end - 1 [end - begin], in the order in which the identifier takes them.

        Raises PvidError when one of them is missing.
        """
        missing = [gap for gap in self.gaps if gap[0] < end and gap[1] > begin]
        if missing or begin < self.first or end > self.ticks:
            place = missing[0] if missing else (self.ticks, end) if end > self.ticks else (begin, self.first)
            raise PvidError(f"the samples of ticks {place[0]} to {place[1] - 1} are missing")
        parts = [self.raw[first][max(0, begin - first) : max(0, end - first)] for first in sorted(self.raw)]
        joined: Samples = np.concatenate(parts)
        return tuple(joined.T)

    def take(self, tick: int, message: Message) -> None:
        """Takes a frame in."""
        match message:
            case Hello():
                self.hello = message
            case Schema():
                self.schema = message.text.decode("ascii")
            case Configuration():
                self.configuration = message
            case Status():
                self.status = message
            case Raw() | RawCount():
                self.raw[tick] = message.values
            case Hash():
                self.hashes[tick] = message.hash
            case Estimate() | EstimateQ31():
                self.estimates[tick] = message
            case RefinedEstimate():
                self.refined[tick] = message
            case _:
                pass


def collect(
    target: Target,
    ticks: int,
    *,
    begin: Streamed | None = None,
    source: Source = Source.SENSOR_PACED,
    hash_every: int = 500,
    estimate_every: int = 500,
    patience_s: float = 20.0,
) -> FieldRecord:
    """Collects the frames of a board in field mode, for `ticks` samples from the first that arrives.

    Raises PvidError when the board refuses, sends nothing for `patience_s`, or the port is gone.

    Parameters
    ----------
    begin : starts the board over, with these settings and `source`, `hash_every`, `estimate_every` [ticks]; None: joins
        the session that goes on
    patience_s : longest silence [s]
    """
    record = FieldRecord()
    decoder = Decoder(record.received)
    configure = None if begin is None else begin.configure(settings_number(begin), hash_every, estimate_every, source)
    session = None if configure is None else configure.session
    now = time.monotonic()
    ask_at = now + target.coming_up_s
    silent_at = ask_at + patience_s
    sequence = 0
    while record.ticks - record.first < ticks:
        now = time.monotonic()
        try:
            if configure is not None and record.status is None and now >= ask_at:
                target.port.write(encode(configure, sequence))
                ask_at, sequence = now + RESEND_S, sequence + 1
            data = target.port.read(4096)
        except OSError as error:
            raise PvidError(f"the port of {target.name} is gone: {error}") from error
        if data:
            silent_at = now + patience_s
            ask_at = ask_at if sequence else now
        elif now > silent_at:
            raise PvidError(f"{target.name} sent nothing for {patience_s:g} s")
        for item in decoder.feed(data):
            if not isinstance(item, Frame):
                continue
            if isinstance(item.message, Status) and item.message.session == session:
                session = None  # from here on all is of this session
            if session is None:
                record.take(item.tick, item.message)
        if configure is not None and record.status is not None and record.status.code != Code.RUNNING:
            raise PvidError(f"{target.name} refused: {refusal(record.status)}")
    return record
