"""What a lying board does: every behaviour is a row with what it sends, in order.

Most are honest first: what was recorded before the lie must be readable whatever comes after it.
"""

from __future__ import annotations

import math
import random
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

from cobs import cobs
from lying_board import (
    CHECK_EVERY,
    PER_FRAME,
    RATE,
    SESSION,
    TICKS,
    Flood,
    HangUp,
    LyingBoard,
    Pause,
    Step,
    message,
)

from pvid.link import frames as link
from pvid.link.frames import (
    MAX_PAYLOAD,
    PLACES,
    SCHEMA,
    SCHEMA_TEXT,
    WIDE,
    WIDE_SCHEMA,
    Configure,
    ConfigureQ31,
    Credit,
    Estimate,
    EstimateQ31,
    Hash,
    Hello,
    Names,
    Raw,
    RawCount,
    Schema,
    Status,
    pairs,
)
from pvid.log import file as logfile
from pvid.log.file import LOG_SCHEMA, LOG_SCHEMA_TEXT

Steps = Iterator[Step]
NAN, INF, HUGE, TINY = math.nan, math.inf, 3e38, 1e-45
ABSURD = (NAN, INF, -INF, HUGE, -1.0, 0.0, TINY)
ESCAPES = "\x1b]0;PWN\x07\x1b[31m"
LARGEST = 2**31 - 1
_PAIRS = len(pairs(PLACES))  # of parameters


@dataclass(frozen=True)
class Behaviour:
    """One of BEHAVIOURS: `log` are the exit codes that `pvid log` may have at its end."""

    name: str
    log: tuple[int, ...]
    honest_first: bool
    lie: Callable[[LyingBoard], Iterable[Step]]

    def steps(self, board: LyingBoard) -> Steps:
        """An honest run, where it is wanted, and then the lie."""
        if self.honest_first:
            yield board.honest()
        yield from self.lie(board)


BEHAVIOURS: dict[str, Behaviour] = {}
Lie = Callable[[LyingBoard], Iterable[Step]]


def _enter(lies: Mapping[str, Lie], *log: int, honest_first: bool = True) -> None:
    """Enters behaviours; exit code 0 where no other is named."""
    BEHAVIOURS.update({name: Behaviour(name, log or (0,), honest_first, lie) for name, lie in lies.items()})


def _hellos(**values: tuple[object, ...]) -> Lie:
    """An honest run under each of these values of its Hello."""

    def lie(board: LyingBoard) -> Steps:
        for name, some in values.items():
            for value in some:
                board.sequence = 0
                yield board.honest(board.hello(**{name: value}))

    return lie


def _configurations(**values: tuple[object, ...]) -> Lie:
    """The same, of its configuration."""

    def lie(board: LyingBoard) -> Steps:
        for name, some in values.items():
            for value in some:
                board.sequence = 0
                yield board.honest(configure=board.configure(**{name: value}))

    return lie


def _schemas(*schemas: tuple[Any, ...]) -> Lie:
    """Schema texts, each with frames of it."""
    return lambda board: (board.schema(*one) for one in schemas)


def _forged(*frames: logfile.Segment | logfile.Mark | logfile.Close | logfile.Rig) -> Lie:
    """Frames of the logger's own kind."""
    return lambda board: (board.say(one, tick, LOG_SCHEMA) for tick in (0, 1, 2**32 - 1) for one in frames)


def _of_each(values: Iterable[Any], make: Callable[[LyingBoard, Any], Iterable[Step]]) -> Lie:
    """What is made of each value."""
    kept = tuple(values)
    return lambda board: chain.from_iterable(make(board, value) for value in kept)


def _flat(board: LyingBoard, phi: float = 0.01, y: float = 0.001) -> Steps:
    """A run whose samples are all the same."""
    yield from board.introduction()
    for tick in range(0, 2000, PER_FRAME):
        yield board.say(board.samples(phi, y), tick)
    yield board.say(board.estimate(), 2000)


def _from_each_start(board: LyingBoard) -> Steps:
    for _ in range(100):
        board.sequence = 0
        yield board.say(board.hello())
        yield board.say(board.samples(), 0)


def _without_units(board: LyingBoard) -> Steps:
    for value in ABSURD:
        board.sequence = 0
        yield board.say(board.hello(core=1, phi_lsb=value, y_lsb=value, p_unit=(value,) * PLACES))
        yield board.say(message(ConfigureQ31, session=SESSION, phi_offset=LARGEST))
        yield board.say(RawCount.of_values([LARGEST] * 9, [-LARGEST] * 9))
        yield board.say(message(EstimateQ31, session=SESSION, p=(LARGEST,) * PLACES, se=(-1,) * PLACES), 9)


def _of_another_version(number: int) -> bytes:
    raw = struct.pack("<BBIHI", 2, 5, SCHEMA, number, number) + bytes(80)
    return bytes(cobs.encode(raw + struct.pack("<I", zlib.crc32(raw)))) + b"\0"


def _cut(board: LyingBoard) -> Steps:
    cut = random.Random(1)
    for i in range(300):
        frame = board.say(board.samples(), TICKS + PER_FRAME * i)
        yield frame[: cut.randrange(len(frame) + 1)]


def _with_wrong_crc(frame: bytes) -> bytes:
    return frame[:40] + bytes([frame[40] % 255 + 1]) + frame[41:]


def _numbered_at_random(board: LyingBoard) -> Steps:
    number = random.Random(1)
    for tick in range(TICKS, TICKS + 100 * PER_FRAME, PER_FRAME):
        board.sequence = number.randrange(1 << 16)
        yield board.say(board.samples(), tick)


def _noise(board: LyingBoard) -> Steps:
    noise = random.Random(1)
    for _ in range(20):
        yield noise.randbytes(1100)
        yield Pause(0.05)


def _stalled(board: LyingBoard) -> Steps:
    frame = board.say(board.estimate(), TICKS)
    yield from (frame[:20], Pause(1.5), frame[20:])


def _name_of_bytes(board: LyingBoard) -> Steps:
    payload = board.hello(board="N" * 16).payload
    name = b"\xff\xfe\xed\xa0\x80\xe2\x80\xae\x9b31m\0x\x7f"
    yield board.raw(Hello.TYPE, payload.replace(b"N" * 16, name.ljust(16)))


def _of_the_other_core(board: LyingBoard) -> Steps:
    yield board.say(board.hello())
    yield board.say(message(ConfigureQ31, session=SESSION, settings=board.hello().settings, row_sd=-1))
    yield board.say(RawCount.of_values([1] * 9, [1] * 9), 0)
    yield board.say(message(Hash, session=SESSION), 9)
    yield board.honest()
    yield board.say(message(EstimateQ31, session=SESSION, updates=1), TICKS)


def _named(board: LyingBoard, number: int, text: bytes) -> Steps:
    yield board.say(message(Names, text=text))
    yield board.say(board.samples(), number * PER_FRAME)
    yield board.say(board.estimate(), (number + 1) * PER_FRAME)


def _samples_of_any_number(board: LyingBoard) -> Steps:
    for number in range(256):
        payload = bytes([7, 0, 0, 0, 0, 0, number]) + b"\0" * (4 * PER_FRAME)
        yield board.raw(Raw.TYPE, payload, number * PER_FRAME)
    yield from _hellos(samples=(0, 1, 3, 8, 9, 255))(board)


def _log_of_the_logger(board: LyingBoard) -> Steps:
    yield board.say(message(Schema, text=LOG_SCHEMA_TEXT.encode()), 77, LOG_SCHEMA)
    yield board.say(logfile.Segment(0, 1, b'{"port": "elsewhere"}'), 77, LOG_SCHEMA)
    yield board.say(logfile.Rig(0, 8, b"l1 = 9.9"), 77, LOG_SCHEMA)
    yield board.honest()
    yield board.say(logfile.Close(2, 2, b"the end"), 77, LOG_SCHEMA)


def _no_numbers(board: LyingBoard) -> Steps:
    for p in (*ABSURD, 1e30):
        for variance in (*ABSURD, 1e30):
            told = {"p": (p,) * PLACES, "covariance": (variance,) * _PAIRS}
            yield board.say(board.estimate(**told), TICKS)
            yield board.say(board.estimate(**told, kappa=NAN, residual_sd=INF, weight=-1.0), TICKS)


def _counters(board: LyingBoard) -> Steps:
    yield board.say(board.estimate(updates=2**32 - 1), TICKS)
    names = ("updates", "rejected", "repeated", "skipped", "missing", "malformed", "bad_crc", "foreign")
    yield board.say(board.status(**dict.fromkeys(names, 2**32 - 1)))


def _longest(board: LyingBoard) -> Steps:
    ticks = (MAX_PAYLOAD - len(Raw(b"").payload)) // 8  # of two samples
    return (board.say(board.samples(count=ticks), tick) for tick in range(TICKS, TICKS + 20 * ticks, ticks))


_FIELDS = b" ".join(b"a%d:u8" % i for i in range(12))
_FRONT = b"pvid 1\n" + b"\n".join(b"%d k%d " % (i, i) + _FIELDS for i in range(1, 20))
_MANY = b"pvid 1\n6 a " + b" ".join(b"%c%c:u8" % (97 + i // 26, 97 + i % 26) for i in range(330))
_OF_LOGGER = b"pvid 1\n" + b"\n".join(b"%d segment a:u8" % number for number in range(240, 245))
_P6 = b"pvid 1\n6 estimate p:%s q:u8"
_SHORT = (b"pvid 1", b"pvid 1\n", b"pvid 1\n\n\n", b"pvid 1\n1", b"pvid 1\n1 a", b"pvid 1\n1 a ", b"\0\0")


def _kinds(number: int) -> bytes:
    return b"pvid 1\n" + b"\n".join(b"%d kind_%d_%d a:u8" % (kind, number, kind) for kind in range(1, 60))


_enter({"nothing but the truth": lambda board: [b""]})

# ---- schemas

_enter(
    {
        "schema with an array of 0": _schemas(
            *((_P6 % b"%s[0]" % kind, (6, b"\1")) for kind in (b"u8", b"f32", b"char"))
        ),
        "schema with an array beyond a frame": _schemas(
            *(
                (b"pvid 1\n6 estimate p:f32[%s]" % count, (6, bytes(8)))
                for count in (b"2049", b"9999", b"9" * 300, b"9" * 1900)
            )
        ),
        "schema with an open end amid it": _schemas(
            (b"pvid 1\n6 estimate p:f32[] q:u8[] r:u8", (6, bytes(9)), (6, b""))
        ),
        "schema with fields of one name": _schemas(
            (b"pvid 1\n6 estimate kind:u8 values:u8 self:u8 self:u8", (6, bytes(4)))
        ),
        "schema with names of python": _schemas(
            (b"pvid 1\n6 __class__ kind:u8 values:u8 self:u8 __dict__:u8", (6, bytes(4)))
        ),
        "schema with digits of other scripts": _schemas(
            ("pvid 1\n² x a:u8".encode(), (2, b"\1")),
            (b"pvid 1\n\xb2 x a:u8", (2, b"\1")),
            ("pvid ٣\n3 x a:u8[٣]".encode(), (3, b"\1")),
            (b"pvid 99999999999999999999999\n999999999999999999999999 x a:u8", (9, b"\1")),
        ),
    }
)
_enter(
    {
        "schema that is cut short": _schemas(
            *((SCHEMA_TEXT.encode()[:end], (6, b"\1")) for end in range(0, len(SCHEMA_TEXT), 97)),
            *((text, (1, b"\1"), (2, text)) for text in _SHORT),
        )
    },
    1,
)
_enter(
    {
        "schema that describes a type twice": _schemas((b"pvid 1\n6 a b:u8\n6 a b:f32", (6, b"\1"), (6, bytes(4)))),
        "schema of 500 fields": _schemas((_MANY, (6, bytes(330)))),
        "schema with escapes in its names": _schemas(
            (b"pvid 1\n1 a\x1b[31m b:u8", (1, b"\1")),
            (b"pvid 1\n1 a b\x1b]0;PWN\x07:u8", (1, b"\1")),
            (b"pvid 1\x1b[2J\n1 a b:u8", (1, b"\1")),
        ),
        "schema under a number that is not its own": lambda board: [
            board.raw(Schema.TYPE, b"pvid 1\n6 estimate p:u8", 0, 12345),
            board.raw(6, b"\1", 0, 12345),
        ],
        "schema of today with other types": lambda board: [
            board.schema(
                SCHEMA_TEXT.replace("6 estimate", "60 estimate").encode(),
                *((number, board.estimate().payload) for number in (60, 6)),
            )
        ],
        "schema of the logger s frames": _schemas(
            (LOG_SCHEMA_TEXT.encode(), (240, message(logfile.Segment).payload)),
            (_OF_LOGGER, *((number, b"\1") for number in range(240, 245))),
        ),
        "schemas without end": _schemas(*((_FRONT + b"\n99 x%d a:u8" % i, (99, b"\1")) for i in range(500))),
        "kinds without end": _schemas(*((_kinds(i), *((kind, b"\1") for kind in range(1, 60))) for i in range(60))),
    }
)

# ---- what it calls itself

_MARKUP = ("[red]x[/]", "[/]", "[link=a:b]c", "$\\frac{1}{0$", "%s%n{0}", "=1+1", "a\r\nb\tc")
_enter(
    {
        "a name of escapes": _of_each(
            3 * ["\x1b]0;PWN\x07\x1b[31mX"], lambda board, name: [board.say(board.hello(board=name)), Pause(0.3)]
        ),
        "a name of html": _of_each(
            ("<img src=x onerr", "</script><b>"), lambda board, name: [board.say(board.hello(board=name))]
        ),
        "a name of markup": _of_each(_MARKUP, lambda board, name: [board.say(board.hello(board=name)), Pause(0.3)]),
        "a name of formulas": lambda board: [board.say(board.hello(board="$\\frac{1}{0$"))],
        "a name of bytes beyond ascii": _name_of_bytes,
        "no name": lambda board: [board.say(board.hello(board=""))],
    }
)
_enter(
    {"escapes in its name from the first frame on": lambda board: [board.honest(board.hello(board=ESCAPES[:16]))]},
    honest_first=False,
)

# ---- numbers of its Hello

_enter(
    {
        "sample rates that are none": _hellos(sample_rate=ABSURD),
        "sample rates at the edge": _hellos(sample_rate=(1e-38, 1e38, 1e-3, 1e9, 0.999e-3)),
    },
    honest_first=False,
)
_enter(
    {
        "another sample rate every second": _of_each(
            enumerate((1.0, 1e6, NAN, RATE), start=TICKS // PER_FRAME),
            lambda board, one: [
                board.say(board.hello(sample_rate=one[1])),
                board.say(board.samples(), one[0] * PER_FRAME),
            ],
        )
    }
)
_enter(
    {
        "numbers of parameters": _hellos(n_p=(0, 1, 5, 255)),
        "forms and cores that there are not": _hellos(form=(3, 255), core=(2, 255)),
        "the other form and the other core": _hellos(form=(0, 1), core=(1,)),
        "windows of none and of all": _hellos(window=(0, 65535)),
        "units that are none": _hellos(
            phi_lsb=ABSURD, y_lsb=ABSURD, p_unit=tuple((value,) * PLACES for value in ABSURD)
        ),
        "units that are none in fixed point": _without_units,
        "sessions that never begin": _of_each(
            range(4),
            lambda board, _: [
                board.say(board.hello(session=0)),
                board.say(board.status(session=0, code=0)),
                Pause(0.5),
            ],
        ),
    },
    honest_first=False,
)
_enter(
    {
        "another session in every frame": _of_each(
            range(300),
            lambda board, i: [
                board.say(board.hello(session=i)),
                board.say(message(Hash, session=2**32 - 1 - i), TICKS + i),
            ],
        )
    }
)
_enter(
    {
        "settings of another image": lambda board: [board.honest(board.hello(settings=1), board.configure(settings=1))],
        # its configuration
        "row sd that is none": _configurations(row_sd=ABSURD),
        "laws that there are not": _configurations(law=(2, 200, 255)),
        "dividers of none and of all": _configurations(divider=(0, 65535)),
        "starts that are none": _configurations(start=tuple((value,) * PLACES for value in ABSURD)),
        "standard deviations that are none": _configurations(start_sd=tuple((value,) * PLACES for value in ABSURD)),
        "limits that are none": _configurations(
            lower=tuple((value,) * PLACES for value in (NAN, INF, HUGE)),
            upper=tuple((value,) * PLACES for value in (NAN, -INF, 0.0)),
        ),
        "memories and feedbacks that are none": _configurations(forgetting_s=ABSURD, feedback_hz=ABSURD),
        "sources and forms that there are not": _configurations(source=(3, 255), form=(0, 7), hash_every=(0,)),
        "the configuration of the other core": _of_the_other_core,
    },
    honest_first=False,
)
_enter(
    {"configurations without end": _of_each(range(2000), lambda board, i: [board.say(board.configure(session=i + 1))])}
)

# ---- names

# What a board says about its mechanism; the last three are mechanisms that there can be.
NAMED = (
    b"",
    b"motor",
    b"motor\np R ohm",
    b"motor\nsample V V",
    b"\x1b]0;PWN\x07\nsample V V\np R ohm",
    b"motor\nsample \x1b[31m V\np R ohm",
    b"motor\nsample V V\np R \x1b[31m",
    b"motor\nsample V V\nsample V V\np R ohm",
    b"motor\nsample t s\np R ohm",
    b"motor\nsample V V\np R ohm\np R_se ohm",
    b"motor\nsample V V\np kappa 1",
    b"motor\nsample V V\np R ohm\n" * 2,
    b"motor\nsample V V" + b"\np R ohm" * 9,
    b"motor\n" + b"\n".join(b"sample s%d" % i for i in range(9)) + b"\np R ohm",
    b"motor\nsample V V\np " + b"R" * 33,
    b"motor\nsample V V\np R " + b"m" * 25,
    b"motor\nsample V V\np R o;m:1|2,",
    b"\xff" * 2000,
    b"kapitza\nsample y m\nsample phi rad\np w",
    b"motor\nsample V V\np R ohm",
    b"pump\nsample V V\nsample i A\nsample q\np a\np b\np c\np d\np e\np f\np g\np h",
)

_enter(
    {
        "names that are none and names of others": _of_each(enumerate(NAMED), lambda board, one: _named(board, *one)),
        "another mechanism all the time": _of_each(
            range(300),
            lambda board, i: _named(board, i, b"m%d\nsample s%d V\np p%d ohm" % (i, i, i)),
        ),
    },
    honest_first=False,
)
_enter({"samples of any number a tick": _samples_of_any_number}, 1, honest_first=False)

# ---- estimates, hashes, credits, samples

_BEYOND = ((31.0, 8.0, 7.0), (-31.0, 8.0, 5.0), (31.0, 0.0, 0.0), (1e-30, 1.0, 1.0), (1e30, 1e30, -1e30))
_enter(
    {
        "estimates that are no numbers": _no_numbers,
        "kappas and residuals that are none": _of_each(
            ABSURD,
            lambda board, value: (
                board.say(board.estimate(**{name: value}), TICKS) for name in ("kappa", "residual_sd", "weight")
            ),
        ),
        "reasons that there are not": _of_each(
            range(256), lambda board, reason: [board.say(board.estimate(reason=reason), TICKS)]
        ),
        "estimates beyond physics": _of_each(
            _BEYOND, lambda board, p: [board.say(board.estimate(p=(*p, *[0.0] * (PLACES - 3))), TICKS)]
        ),
        "estimates of more parameters": _of_each(
            ABSURD,
            lambda board, value: (
                board.say(one, TICKS, WIDE_SCHEMA)
                for one in (
                    board.estimate(p=(value,) * WIDE, covariance=(value,) * len(pairs(WIDE))),
                    message(EstimateQ31, p=(LARGEST,) * WIDE, se=(-1,) * WIDE, correlation=(1,) * len(pairs(WIDE))),
                    board.hello(n_p=WIDE, p_unit=(value,) * WIDE),
                )
            ),
        ),
        "estimates of the other core": _of_each(
            (0, LARGEST, -LARGEST - 1),
            lambda board, value: [
                board.say(
                    message(
                        EstimateQ31,
                        p=(value,) * PLACES,
                        se=(value,) * PLACES,
                        correlation=(value,) * _PAIRS,
                        kappa=value,
                        residual_sd=value,
                    ),
                    TICKS,
                )
            ],
        ),
        "estimates of ticks that never were": _of_each(
            (0, 1, TICKS - 1, TICKS + 1, 10**6, 2**31, 2**32 - 1),
            lambda board, tick: [board.say(board.estimate(), tick)],
        ),
        "counters at their end": _counters,
        "a false hash": lambda board: [board.say(message(Hash, session=SESSION, hash=1), TICKS)],
        "a hash for every tick": _of_each(
            range(TICKS + 5), lambda board, tick: [board.say(message(Hash, session=SESSION, hash=tick), tick)]
        ),
        "credits that nobody asked for": _of_each(
            (0, TICKS, 2**32 - 1),
            lambda board, tick: [board.say(message(Credit, session=SESSION, room=2**32 - 1, hash=1, reason=255), tick)],
        ),
        "samples that are no numbers": _of_each(
            enumerate(ABSURD),
            lambda board, one: [board.say(board.samples(one[1], one[1]), TICKS + one[0] * PER_FRAME)],
        ),
        "samples of the other core": lambda board: [
            board.say(RawCount.of_values([LARGEST] * 9, [-LARGEST] * 9), TICKS),
            board.say(board.samples(), TICKS + 9),
        ],
    }
)
_enter(
    {
        "sample frames of odd lengths": _of_each(
            (0, 1, 7, 8, 12, 2047, 2048), lambda board, length: [board.raw(Raw.TYPE, bytes(length), TICKS)]
        )
    },
    1,
)
_enter(
    {
        "a sensor that stands still": _flat,
        "samples that are all zero": lambda board: _flat(board, 0.0, 0.0),
    },
    honest_first=False,
)
_enter(
    {
        "one sample a frame": _of_each(
            range(TICKS, TICKS + 3000), lambda board, tick: [board.say(board.samples(count=1), tick)]
        ),
        "nothing but empty sample frames": _of_each(range(3000), lambda board, _: [board.say(Raw(b""), TICKS)]),
    }
)
_enter(
    {
        "ticks that jump": _of_each(
            (5000, 10**6, 2**31, 0, 2**32 - 1, 100, 99, 98),
            lambda board, tick: [
                board.say(board.samples(), tick),
                board.say(board.estimate(), tick),
                board.say(message(Hash, session=SESSION, hash=1), tick),
            ],
        ),
        "ticks that run backwards": _of_each(
            range(TICKS - PER_FRAME, -1, -PER_FRAME), lambda board, tick: [board.say(board.samples(), tick)]
        ),
    },
    1,
)
_enter(
    {
        "ticks at the end of 32 bits": lambda board: chain(
            board.introduction(),
            (board.say(board.samples(), (2**32 - 1000 + i * PER_FRAME) % 2**32) for i in range(100)),
        )
    },
    honest_first=False,
)
_enter(
    {
        "the same samples again and again": lambda board: (
            20 * [b"".join(link.encode(board.samples(), i, PER_FRAME * i) for i in range(40))]
        ),
        "a start at every moment": _from_each_start,
        # what it does
        "a refusal after it has run": _of_each(
            (0, 2, 3, 4, 5, 6, 7, 255),
            lambda board, code: [
                board.say(board.hello(session=0)),
                board.say(board.status(code=code, core=255)),
                Pause(0.1),
            ],
        ),
    }
)
_enter(
    {
        "every code of a status": lambda board: chain(
            [board.say(board.hello())], (board.say(board.status(code=code, core=255 - code)) for code in range(256))
        )
    },
    honest_first=False,
)
_enter(
    {
        "frames that only the pc sends": lambda board: [
            board.say(link.Sample.of_values([1.0], [2.0]), TICKS),
            board.say(link.Count.of_values([1], [2]), TICKS),
        ]
    }
)

# ---- frames of the logger's own kind

_ABOUT = (b"{}", b'{"port": "\\ud800\\u001b[31mX"}', b'{"port": 5}', b"[" * 1900, b'{"port":' + b"[" * 1900)
_enter(
    {
        "segments of the logger": lambda board: chain.from_iterable(
            _forged(message(logfile.Segment, number=99, unix_ns=2**64 - 1, about=about))(board) for about in _ABOUT
        ),
        "times of the logger": _forged(*(logfile.Mark(when, when) for when in (0, 1, 2**63, 2**64 - 1))),
    }
)
_enter(
    {
        "ends of the logger": lambda board: chain(
            _forged(logfile.Close(2**64 - 1, 5, b"\x1b]0;PWN\x07\x1b[31mbye\xff"), logfile.Close(0, 0, b""))(board),
            (board.say(board.samples(), TICKS) for _ in range(1)),
        )
    },
    1,
)
_enter(
    {
        "rig files of the logger": _forged(logfile.Rig(0, 8, b"l1 = 9.9"), logfile.Rig(0, 2**32 - 1, b"x" * 2000)),
        "schemas of the logger": lambda board: [
            board.say(logfile.LinkSchema(b"pvid 1\n6 e p:u8[0]"), 0, LOG_SCHEMA),
            board.say(message(Schema, text=LOG_SCHEMA_TEXT.encode()), 0, LOG_SCHEMA),
        ],
        "segments of the logger without end": lambda board: (
            5 * [b"".join(board.say(logfile.Segment(i, 1, b"{}"), 0, LOG_SCHEMA) for i in range(1000))]
        ),
    }
)
_enter({"a log of the logger from its first byte on": _log_of_the_logger}, honest_first=False)
_enter(
    {
        "frames of the logger with no layout": _of_each(
            (0, 2, 240, 241, 242, 243, 244, 245, 255),
            lambda board, number: (board.raw(number, bytes(length), 0, LOG_SCHEMA) for length in (0, 3, 2048)),
        )
    },
    1,
)

# ---- the line

_enter(
    {
        "nothing but noise": _noise,
        "nothing but text": lambda board: 300 * [b"\x1b[2J\x1b]0;PWN\x07boot: hello <script>alert(1)</script>\r\n"],
        "a line of text and silence": lambda board: [b"hello\r\n", Pause(0.5)],
        "nothing but zeros": lambda board: [bytes(100_000)],
        "nothing but ones": lambda board: [b"\xff" * 100_000],
        "frames of a schema that nobody knows": _of_each(
            range(100), lambda board, i: [board.raw(5, bytes(100), i, 12345)]
        ),
        "frames of another version of the link": lambda board: map(_of_another_version, range(100)),
    },
    1,
    honest_first=False,
)
_enter(
    {
        "frames that are cut short": _cut,
        "frames with a wrong crc": _of_each(
            range(100), lambda board, i: [_with_wrong_crc(board.say(board.samples(), TICKS + PER_FRAME * i))]
        ),
    },
    1,
)
_enter({"frames of the longest payload": _longest})
_enter(
    {
        "frames that never end": lambda board: [b"\x01" * 3_000_000],
        "frames of types that there are not": _of_each(
            range(256), lambda board, number: [board.raw(number, bytes(7), TICKS)]
        ),
        "sequence numbers at random": _numbered_at_random,
    },
    1,
)
_enter({"silence": lambda board: [Pause(0.5)]}, honest_first=False)
_enter(
    {
        "a stall amid a frame": _stalled,
        "a line that is hung up amid a frame": _of_each(
            range(TICKS, TICKS + 3 * PER_FRAME, PER_FRAME),
            lambda board, tick: [board.say(board.samples(), tick)[:50], HangUp()],
        ),
        "a line that is hung up at once again and again": lambda board: 3 * [HangUp()],
    }
)

# ---- floods, of which some is not decoded: 1


def _flood(made: Callable[[LyingBoard], Iterable[bytes]]) -> Lie:
    return lambda board: [Flood(b"".join(made(board)))]


_KINDS = (Configure, Estimate, Status)
_enter(
    {
        "a flood of noise": _flood(lambda board: [random.Random(1).randbytes(1 << 16)]),
        "a flood of zeros": _flood(lambda board: [bytes(1 << 16)]),
        "a flood without a zero": _flood(lambda board: [b"\x01" * (1 << 16)]),
        "a flood of single bytes": _flood(lambda board: [b"x\0" * (1 << 15)]),
        "a flood of estimates": _flood(lambda board: (board.say(board.estimate(), TICKS) for _ in range(300))),
        "a flood of samples": _flood(
            lambda board: (board.say(board.samples(count=64), TICKS + 64 * i) for i in range(200))
        ),
        "a flood of hashes": _flood(
            lambda board: (board.say(message(Hash, session=SESSION), CHECK_EVERY) for _ in range(2000))
        ),
        "a flood of starts": _flood(lambda board: (link.encode(board.hello(session=i), 0) for i in range(500))),
        "a flood of schemas": _flood(
            lambda board: (
                board.schema(b"pvid 1\n" + b"\n".join(b"%d k%d a:u8" % (j, i) for j in range(90))) for i in range(100)
            )
        ),
        "a flood of configurations": _flood(
            lambda board: (board.say(message(_KINDS[i % 3], session=i)) for i in range(900))
        ),
    },
    0,
    1,
)
