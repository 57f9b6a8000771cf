"""A board that lies, as the bytes it sends: an honest run first, then what `bench.lies` makes of it."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from pvid.base.toml_text import toml_document
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.stream_image import settings_number
from pvid.codegen.weak_library import weak_native
from pvid.link import frames as link
from pvid.link.frames import (
    PLACES,
    SCHEMA,
    SCHEMA_TEXT,
    Code,
    Configure,
    Estimate,
    Hash,
    Hello,
    Message,
    Names,
    Raw,
    Schema,
    Status,
)
from pvid.log.mechanism import LogMechanism
from pvid.log.rig import mechanism_in
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.record import standing_word
from pvid.twin import fnv

SESSION = 7
TICKS = 800  # of the honest run: two windows of the standard rig and more
RATE = 1000.0  # [Hz]
PER_FRAME = 20  # samples
CHECK_EVERY = 400  # ticks, estimates and hashes

Kind = TypeVar("Kind", bound=Message)


@dataclass(frozen=True)
class Pause:
    """Nothing is sent for a while."""

    seconds: float


@dataclass(frozen=True)
class HangUp:
    """The line is closed, and opened again when it is taken up."""


@dataclass(frozen=True)
class Flood:
    """The same bytes again and again, as fast as the line takes them."""

    data: bytes


Step = bytes | Pause | HangUp | Flood


def message(kind: type[Kind], **values: Any) -> Kind:
    """A message of these values; 0, no text and no bytes where a field is not named."""
    for name, of, count in kind.layout().fields:
        if name == "samples" and name not in values:
            values[name] = 2
        if name not in values:
            zero: Any = 0.0 if of == "f32" else 0
            values[name] = b"" if count is None else "" if of == "char" else zero if count == 1 else (zero,) * count
    return kind(**values)


@cache
def rig() -> MechanismRig:
    """The rig that the logger is given."""
    return MechanismRig("kapitza", RATE, known={"l1": 0.3})


@cache
def mechanism() -> LogMechanism:
    """Of the rig."""
    found = mechanism_in(toml_document(rig().text()))
    assert found is not None
    return found


@cache
def board() -> MechanismBoard:
    """The honest board."""
    return MechanismBoard.of_guess(rig())


@cache
def _settings() -> int:
    return settings_number(board())


def estimate_of(own: Any, frame: type[Kind], **values: Any) -> Kind:
    """The frame of an estimate as a core has it."""
    names = {one.name for one in fields(frame)}
    values |= {name: padded(own[name]) for name in names & {"p", "se"}}
    values |= {name: link.upper_triangle(own[name]) for name in names & {"covariance", "correlation"}}
    values |= {name: own[name].item() for name in ("kappa", "residual_sd", "weight")}
    standing = own["standing"]
    values["standing"] = standing if isinstance(standing, int) else standing_word(standing)
    return frame(**values)


def padded(row: Any) -> tuple[Any, ...]:
    """As many numbers as a frame has."""
    return tuple(np.resize(np.append(row, np.zeros(PLACES, np.asarray(row).dtype)), PLACES).tolist())


@cache
def _honest_run() -> tuple[tuple[int, Message], ...]:
    """(tick, message) of a board that does what it should, with the bits of the core on this machine."""
    own = board()
    identifier = weak_native(own.compiled, own.config.design).identifier_of(own.config)
    t = np.arange(TICKS) / RATE
    phi = (0.05 * np.sin(9.0 * t)).astype(np.float32)
    y = (0.004 * np.sin(13.0 * t) + 0.002 * np.sin(31.0 * t)).astype(np.float32)
    samples = own.readings(y, phi)
    of_samples = fnv.sample_hashes(samples)
    sent: list[tuple[int, Message]] = []
    for first in range(0, TICKS, CHECK_EVERY):
        part = slice(first, first + CHECK_EVERY)
        record = identifier.run_samples(samples[part], sums=False)
        for tick in range(first, first + CHECK_EVERY, PER_FRAME):
            raw = Raw.of_values(*samples[tick : tick + PER_FRAME].T)
            sent.append((tick, replace(raw, session=SESSION)))
        updates, reason = identifier.counters["updates"], int(record.reason[-1])
        estimate = estimate_of(identifier.estimate, Estimate, session=SESSION, updates=updates, reason=reason)
        hashed = message(
            Hash, session=SESSION, hash=identifier.running_hash, sample_hash=int(of_samples[first + CHECK_EVERY - 1])
        )
        sent += [(first + CHECK_EVERY, hashed)]
        sent += [(first + CHECK_EVERY, estimate)] if identifier.counters["updates"] else []
    return tuple(sent)


def honest_samples() -> npt.NDArray[np.float32]:
    """y, phi of the honest run, [TICKS, 2]."""
    return np.concatenate([what.values for _, what in _honest_run() if isinstance(what, Raw)])


@cache
def _configuration() -> Configure:
    made = board().configure(_settings(), CHECK_EVERY, CHECK_EVERY)
    assert isinstance(made, Configure)
    return made


class LyingBoard:
    """Makes frames with the sequence numbers of one board."""

    def __init__(self) -> None:
        self.sequence = 0

    def say(self, what: Message, tick: int = 0, schema: int = SCHEMA) -> bytes:
        """A frame."""
        return self.raw(what.TYPE, what.payload, tick, schema)

    def raw(self, number: int, payload: bytes, tick: int = 0, schema: int = SCHEMA) -> bytes:
        """A frame of any type and payload."""
        self.sequence += 1
        return link.encode_raw(number, self.sequence - 1, tick, payload, schema)

    def hello(self, **values: Any) -> Hello:
        """Who the honest board is, but for these values."""
        own, n_p = board(), len(board().p_names)
        honest: dict[str, Any] = {
            "form": int(link.Form.WEAK),
            "core": int(link.Core.F32),
            "n_p": n_p,
            "window": 64,
            "settings": _settings(),
            "session": SESSION,
            "sample_rate": own.sample_rate,
            "phi_lsb": board().compiled.signal("phi").resolution,
            "y_lsb": board().compiled.signal("y").resolution,
            "p_unit": (*[1.0] * n_p, *[0.0] * (PLACES - n_p)),
            "board": "liar",
            "samples": 2,
        }
        return message(Hello, **{**honest, **values})

    def configure(self, **values: Any) -> Configure:
        """The configuration of the honest board, but for these values."""
        honest = {one.name: getattr(_configuration(), one.name) for one in fields(Configure)}
        return Configure(**{**honest, "session": SESSION, **values})

    def status(self, **values: Any) -> Status:
        """Running, but for these values."""
        return message(Status, **{"session": SESSION, "code": int(Code.RUNNING), **values})

    def estimate(self, **values: Any) -> Estimate:
        """A plausible estimate, but for these values."""
        plausible = {
            "session": SESSION,
            "updates": 5,
            "p": (31.0, 8.8, 5.6, *[0.0] * (PLACES - 3)),
            "covariance": (1e-6,) * len(link.upper_triangle([[0.0]])),
            "kappa": 0.01,
            "residual_sd": 1e-4,
            "weight": 10.0,
        }
        return message(Estimate, **{**plausible, **values})

    def samples(self, phi: float = 0.01, y: float = 0.001, count: int = PER_FRAME) -> Raw:
        """Samples that are all the same."""
        return replace(Raw.of_values([y] * count, [phi] * count), session=SESSION)

    def schema(self, text: bytes, *frames: tuple[int, bytes]) -> bytes:
        """A schema text under its own number, and frames of it."""
        number = zlib.crc32(text)
        return b"".join([self.raw(Schema.TYPE, text, 0, number), *(self.raw(*one, 0, number) for one in frames)])

    def introduction(self, hello: Hello | None = None, configure: Configure | None = None) -> Iterator[bytes]:
        """The frames before the samples."""
        yield self.say(hello or self.hello())
        yield self.say(message(Schema, text=SCHEMA_TEXT.encode()))
        yield self.say(message(Names, text=board().names.text.encode()))
        yield self.say(configure or self.configure())
        yield self.say(self.status())

    def honest(self, hello: Hello | None = None, configure: Configure | None = None) -> bytes:
        """A whole honest run, said to come from another board or another configuration where these are given."""
        frames = [*self.introduction(hello, configure), *(self.say(what, tick) for tick, what in _honest_run())]
        return b"".join(frames)
