"""Frames of the serial link, without any input or output of its own.

    COBS(header || payload || CRC-32) || 0x00
    header: version u8, type u8, schema u32, sequence u16, tick u32; little-endian

The header contains the low 32 bits of the tick. Frames of a board also contain the next 16 bits as `tick_high`: 48 bits
last 8900 years at 1 kHz. `Frame.tick` and `encode` combine them. The ticks of a board restart with every session; the
session number in the same frames distinguishes a restart from a wrapped counter.

The classes below with a `TYPE` are the only definition of the payloads: the schema text that a board sends, its hash in
every header and firmware/link/schema.h are generated from them (`pvid schema`).

    decoder = Decoder()
    for item in decoder.feed(port.read(...)):
        match item:
            case Loss(): ...                      # lost data, and why
            case Frame(message=Estimate() as e): ...
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from enum import IntEnum
from functools import cache, cached_property, partial
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from cobs import cobs

from pvid.base.errors import PvidError
from pvid.base.wording import shown

VERSION = 1
MAX_PAYLOAD = 2048
Float = npt.NDArray[np.float64]

# Places for parameters in the frames of a board with at most 8 of them, and with more; those that a model lacks are 0.
PLACES, WIDE = 8, 16
_P, _PAIRS = -1, -2  # counts of a field: of each parameter, of each pair of them
MAX_SAMPLES = 8  # of a tick
MAX_FIELDS = 64  # of a payload that a schema text describes
MAX_LEARNT = 16  # schemas that a decoder keeps of those that a line brought
_HEADER = struct.Struct("<BBIHI")
_CRC = struct.Struct("<I")
_LONGEST = _HEADER.size + MAX_PAYLOAD + _CRC.size
LONGEST_FRAME = _LONGEST + _LONGEST // 254 + 2  # on the line, its 0 among it

_WIRE = {
    "u8": ("B", 1),
    "u16": ("H", 2),
    "u32": ("I", 4),
    "u64": ("Q", 8),
    "i32": ("i", 4),
    "f32": ("f", 4),
    "char": ("s", 1),
}


def _characters(field_of: bytes) -> str:
    """What a field of characters holds up to the zeros at its end, "?" for each that is no printable ASCII."""
    return "".join(chr(one) if 0x20 <= one < 0x7F else "?" for one in field_of.rstrip(b"\0"))


def wire(kind: str, count: int | None = 1, absent: int | None = None) -> Any:
    """A field of `count` numbers of a kind; None: all that is left of the payload, as bytes.

    `absent`: its value in frames of a schema that does not have it yet.
    """
    metadata = {"kind": kind, "count": count}
    return field(metadata=metadata) if absent is None else field(default=absent, kw_only=True, metadata=metadata)


@dataclass(frozen=True)
class Layout:
    """One payload: its type, its name and (field, kind, count) in order; count None: the rest."""

    type: int
    name: str
    fields: tuple[tuple[str, str, int | None], ...]

    @cached_property
    def size(self) -> int:
        """Bytes of the part with a fixed size."""
        return sum(_WIRE[kind][1] * count for _, kind, count in self.fields if count is not None)

    @property
    def open_ended(self) -> bool:
        """Whether the last field takes the rest of the payload."""
        return self.fields[-1][2] is None

    @property
    def text(self) -> str:
        """As it stands in the schema: `6 estimate p:f32[4] ...`."""
        marks = {1: "", None: "[]"}
        words = (f"{name}:{kind}{marks.get(count, f'[{count}]')}" for name, kind, count in self.fields)
        return f"{self.type} {self.name} {' '.join(words)}"

    def unpack(self, payload: bytes) -> dict[str, Any]:
        """Values by field: int, float, tuple of them, str (char, printable ASCII) or bytes (the rest).

        Raises PvidError when the payload has not the length of this layout.
        """
        if len(payload) < self.size or (len(payload) > self.size and not self.open_ended):
            raise PvidError(f"a frame {self.name} of {len(payload)} bytes, where {self.size} belong")
        values: dict[str, Any] = {}
        at = 0
        for name, kind, count in self.fields:
            code, width = _WIRE[kind]
            if count is None:
                rest = payload[at:]
                if len(rest) % width:
                    raise PvidError(f"a frame {self.name} with a {name} of {len(rest)} bytes, no multiple of {width}")
                values[name] = rest
                break
            found = struct.unpack_from(f"<{count}{code}", payload, at)
            if kind == "char":
                values[name] = _characters(found[0])
            else:
                values[name] = found if count > 1 else found[0]
            at += width * count
        return values

    def pack(self, values: dict[str, Any]) -> bytes:
        """The payload of values by field, the inverse of `unpack`."""
        parts = []
        for name, kind, count in self.fields:
            value = values[name]
            if count is None:
                parts.append(bytes(value))
            elif kind == "char":
                parts.append(struct.pack(f"<{count}s", value.encode("ascii")))
            else:
                numbers = value if count > 1 else (value,)
                parts.append(struct.pack(f"<{count}{_WIRE[kind][0]}", *numbers))
        return b"".join(parts)


MESSAGES: dict[int, type[Message]] = {}


@dataclass(frozen=True)
class Message:
    """Base of the payloads; a subclass enters itself among the `messages` it belongs to, the link's by default."""

    TYPE: ClassVar[int] = 0

    def __init_subclass__(cls, messages: dict[int, type[Message]] = MESSAGES) -> None:
        messages[cls.TYPE] = cls

    @property
    def places(self) -> int:
        """For parameters."""
        of_each = [f.name for f in fields(self) if f.metadata.get("count") == _P]
        return len(getattr(self, of_each[0])) if of_each else PLACES

    def refuse_fewer(self, names: Sequence[str]) -> None:
        """PvidError where there are more parameters than places for them."""
        if len(names) > self.places:
            raise PvidError(f"a board of at most {self.places} parameters, where the rig file has {len(names)}")

    @classmethod
    @cache
    def layout(cls, places: int = PLACES) -> Layout:
        """Its wire format with so many places for parameters."""
        counts = {_P: places, _PAIRS: places * (places + 1) // 2}
        of_fields = [(f.name, f.metadata["kind"], f.metadata["count"]) for f in fields(cls)]
        described = tuple((name, kind, counts.get(count, count)) for name, kind, count in of_fields)
        described = tuple(sorted(described, key=lambda one: one[2] is None))  # what takes the rest comes last
        name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
        return Layout(cls.TYPE, name, described)

    @classmethod
    def absent(cls) -> dict[str, int]:
        """The fields that older schemas may lack, with their values there."""
        return {f.name: f.default for f in fields(cls) if f.default is not MISSING}

    @property
    def payload(self) -> bytes:
        """Its bytes on the wire."""
        return self.layout(self.places).pack({f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def of(cls, payload: bytes, places: int = PLACES) -> Self:
        """The message of these bytes."""
        return cls(**cls.layout(places).unpack(payload))


class Form(IntEnum):
    """Which identifier an image holds."""

    STRONG = 0
    WEAK = 2  # 1 was that of a single mechanism


class Core(IntEnum):
    """Which arithmetic an image holds."""

    F32 = 0
    Q31 = 1


class Source(IntEnum):
    """Where the samples come from."""

    PC = 0
    SENSOR = 1  # the board's own, in time: what the line does not take is dropped, and its sequence number with it
    SENSOR_PACED = 2  # the board's own, as fast as the line takes the answers: nothing is dropped


class Code(IntEnum):
    """State of a board (Status.code)."""

    WAITING = 0  # not configured
    RUNNING = 1
    REFUSED_BY_CORE = 2  # Status.core names the field
    REFUSED_SETTINGS = 3  # made for other tables or settings than those in the image
    REFUSED_FORM = 4  # the image holds the other form, or the other core
    ARITHMETIC = 5  # float arithmetic is not what the bits need
    REFUSED_SOURCE = 6  # none of Source


@dataclass(frozen=True)
class Hello(Message):
    """Board to PC: its description. Sent when it starts, when the PC sends a Credit, and, while the board samples by
    itself, every few seconds of its time, with Schema, the configuration in force and Status behind it.

    What the integers of the fixed-point core are worth stands here, so that a log can be read without its rig file:
    a count of a sensor in rad and m, one unit of each p in SI. In float32 p is in SI, and its units are 1.
    """

    TYPE = 1
    form: int = wire("u8")
    core: int = wire("u8")
    n_p: int = wire("u8")
    window: int = wire("u16")  # samples that may be under way without an answer
    settings: int = wire("u32")  # CRC-32 of the settings and tables in the image
    session: int = wire("u32")  # of the configuration it works with; 0: none since it started
    sample_rate: float = wire("f32")  # ticks a second
    phi_lsb: float = wire("f32")
    y_lsb: float = wire("f32")
    p_unit: tuple[float, ...] = wire("f32", _P)
    board: str = wire("char", 16)
    tick_high: int = wire("u16", absent=0)
    samples: int = wire("u8", absent=2)  # of a tick

    @property
    def form_name(self) -> Literal["weak", "strong"]:
        """The form in words; "strong" for a number that none has."""
        return "weak" if self.form == Form.WEAK else "strong"


@dataclass(frozen=True)
class Schema(Message):
    """Board to PC beside Hello: the schema text."""

    TYPE = 2
    text: bytes = wire("char", None)


@dataclass(frozen=True)
class Names(Message):
    """Board to PC behind Schema: the mechanism, its samples and its parameters with their units (link.names)."""

    TYPE = 14
    text: bytes = wire("char", None)


@dataclass(frozen=True)
class Configuration(Message):
    """What both cores are configured with.

    PC to board: start a new session with these settings; the image contains the others and its tables. Board to PC, in
    field mode: the active configuration, bit by bit as received, with every Hello. The bits depend only on it, on the
    image's settings (`Hello.settings` is their number) and on every sample from `first_tick` on.
    """

    session: int = wire("u32")  # any number but 0; comes back in every answer
    settings: int = wire("u32")  # CRC-32 of the settings and tables that the image must hold
    form: int = wire("u8")
    source: int = wire("u8")
    hash_every: int = wire("u16")  # ticks; 0: only in the credits
    estimate_every: int = wire("u16")  # ticks; 0: never
    divider: int = wire("u16")


@dataclass(frozen=True)
class Configure(Configuration):
    """Float32 (estimator.h)."""

    TYPE = 3
    law: int = wire("u8")
    start: tuple[float, ...] = wire("f32", _P)
    start_sd: tuple[float, ...] = wire("f32", _P)
    lower: tuple[float, ...] = wire("f32", _P)
    upper: tuple[float, ...] = wire("f32", _P)
    row_sd: float = wire("f32")
    forgetting_s: float = wire("f32")
    feedback_hz: float = wire("f32")
    first_tick: int = wire("u64", absent=0)  # number of the first sample, of which the board keeps 48 bits


@dataclass(frozen=True)
class ConfigureQ31(Configuration):
    """Fixed point (estimator_q31.h); the formats are the image's."""

    TYPE = 10
    start: tuple[int, ...] = wire("i32", _P)
    start_sd: tuple[int, ...] = wire("i32", _P)
    lower: tuple[int, ...] = wire("i32", _P)
    upper: tuple[int, ...] = wire("i32", _P)
    row_sd: int = wire("i32")
    forgetting_groups: int = wire("u32")
    gain: int = wire("i32")
    phi_offset: int = wire("i32")
    y_offset: int = wire("i32")
    first_tick: int = wire("u64", absent=0)


@dataclass(frozen=True)
class _Ticks(Message):
    """What is measured at consecutive ticks, tick after tick; the first of them is the header's tick."""

    NUMBER: ClassVar[str] = "<f4"

    def of_each(self, samples: int) -> npt.NDArray[Any]:
        """[ticks, samples], of so many samples a tick; what is left over is left out."""
        data: bytes = self.data  # type: ignore[attr-defined]
        ticks = len(data) // (4 * samples)
        return np.frombuffer(data[: 4 * samples * ticks], self.NUMBER).reshape(ticks, samples)

    @classmethod
    def of_values(cls, *columns: npt.ArrayLike) -> Self:
        """From the samples of each sensor [ticks], rounded to what a board would read."""
        data = np.stack([np.asarray(one, cls.NUMBER) for one in columns], axis=1).tobytes()
        known = {f.name for f in fields(cls)}
        values: dict[str, Any] = {"data": data, "samples": len(columns)}
        return cls(**{name: value for name, value in values.items() if name in known})


@dataclass(frozen=True)
class _Measured(_Ticks):
    """Board to PC: what its own sensors gave the identifier. Every sample up to the tick of an Estimate or a Hash has
    been sent before it."""

    def __post_init__(self) -> None:
        if not 0 < self._samples <= MAX_SAMPLES:
            raise PvidError(f"a frame of {self._samples} samples a tick, and there are 1 to {MAX_SAMPLES}")

    @property
    def _samples(self) -> int:
        number: int = self.samples  # type: ignore[attr-defined]
        return number

    @property
    def count(self) -> int:
        """How many ticks."""
        return len(self.values)

    @property
    def values(self) -> npt.NDArray[Any]:
        """float32 or int32 [ticks, samples]."""
        return self.of_each(self._samples)


@dataclass(frozen=True)
class Sample(_Ticks):
    """PC to board, to be identified with: float32 in the units of the model, exactly as the identifier gets them."""

    TYPE = 4
    data: bytes = wire("f32", None)


@dataclass(frozen=True)
class Raw(_Measured):
    """Board to PC: float32 in the units of the model, exactly as the identifier got them."""

    TYPE = 5
    data: bytes = wire("f32", None)
    session: int = wire("u32", absent=0)
    tick_high: int = wire("u16", absent=0)
    samples: int = wire("u8", absent=2)  # of a tick

    def in_si(self, lsb: Float) -> Float:
        """[ticks, samples] in the units of the model, whatever a count of the board's sensors is worth."""
        return self.values.astype(np.float64)


@dataclass(frozen=True)
class Count(_Ticks):
    """PC to board, to be identified with: counts for the fixed-point core."""

    TYPE = 11
    NUMBER: ClassVar[str] = "<i4"
    data: bytes = wire("i32", None)


@dataclass(frozen=True)
class RawCount(_Measured):
    """Board to PC: what its own sensors counted, as Raw."""

    TYPE = 12
    NUMBER: ClassVar[str] = "<i4"
    data: bytes = wire("i32", None)
    session: int = wire("u32", absent=0)
    tick_high: int = wire("u16", absent=0)
    samples: int = wire("u8", absent=2)

    def in_si(self, lsb: Float) -> Float:
        """[ticks, samples] in the units of the model by the value of a count [samples]; NaN for another number of
        samples."""
        if self.samples != len(lsb):
            return np.full(self.values.shape, np.nan)
        return self.values.astype(np.float64) * lsb


NO_STANDING = 0xFFFFFFFF  # of a board that reports none


def in_places(numbers: Sequence[Any]) -> tuple[Any, ...]:
    """One number for each parameter, filled up with zeros: as in a frame."""
    places = PLACES if len(numbers) <= PLACES else WIDE
    return (*numbers, *[type(numbers[0])(0)] * (places - len(numbers)))


def upper_triangle(matrix: npt.ArrayLike) -> tuple[Any, ...]:
    """The upper triangle by rows of a matrix [n, n], n at most WIDE, filled up with zeros: as in a frame."""
    given = np.asarray(matrix)
    places = PLACES if len(given) <= PLACES else WIDE
    whole = np.zeros((places, places), given.dtype)
    whole[: len(given), : len(given)] = given
    return tuple(whole[np.triu_indices(places)].tolist())


def pairs(places: int) -> tuple[tuple[int, int], ...]:
    """Of parameters, in the order of an upper triangle."""
    return tuple((a, b) for a in range(places) for b in range(a, places))


def _symmetric(upper: tuple[float, ...], places: int) -> Float:
    """The matrix [places, places] of its upper triangle by rows."""
    matrix = np.zeros((places, places))
    matrix[np.triu_indices(places)] = upper
    return matrix + np.triu(matrix, 1).T


@dataclass(frozen=True)
class Estimate(Message):
    """Board to PC: the estimate after the header's tick (pvid_estimate_f32).

    `reason` is reason of the last group of rows: of the last tick that was more than one row accumulated. `standing` is
    that of the published estimate (pvid/standing.h): age + 2^16 state + 2^24 causes; NO_STANDING in the strong form.
    """

    TYPE = 6
    session: int = wire("u32")
    updates: int = wire("u32")
    p: tuple[float, ...] = wire("f32", _P)
    covariance: tuple[float, ...] = wire("f32", _PAIRS)  # upper triangle by rows, of all places
    kappa: float = wire("f32")
    residual_sd: float = wire("f32")
    weight: float = wire("f32")
    reason: int = wire("u8")
    tick_high: int = wire("u16", absent=0)
    standing: int = wire("u32", absent=NO_STANDING)

    FULL_KAPPA: ClassVar[float] = 1.0

    def in_si(self, units: Float, zero: float) -> tuple[Float, Float]:
        """p [places] and its covariance [places, places], in the board's units."""
        return np.array(self.p), _symmetric(self.covariance, self.places)


@dataclass(frozen=True)
class RefinedEstimate(Message):
    """Board to PC beside every Estimate, which is the weak form's, if there is a second stage (refine.h).

    p and covariance are what both stages publish (pvid_refine_best_f32), `stage` is whose they are (Stage). r, se,
    level and clash are of the refinement's estimate (of r what names.shown_of_refined says), and `number` is its
    number; all are 0 while none stands. `reason` is what its last block told.
    """

    TYPE = 15
    session: int = wire("u32")
    number: int = wire("u32")
    p: tuple[float, ...] = wire("f32", _P)
    covariance: tuple[float, ...] = wire("f32", _PAIRS)  # upper triangle by rows, of all places
    r: tuple[float, ...] = wire("f32", _P)
    se: tuple[float, ...] = wire("f32", _P)
    level: float = wire("f32")
    clash: float = wire("f32")
    reason: int = wire("u8")
    stage: int = wire("u8")
    tick_high: int = wire("u16")

    @property
    def of_p(self) -> tuple[Float, Float]:
        """p [places] and its covariance [places, places]."""
        return np.array(self.p), _symmetric(self.covariance, self.places)


@dataclass(frozen=True)
class EstimateQ31(Message):
    """Board to PC: the same of the fixed-point core (pvid_estimate_q31)."""

    TYPE = 13
    session: int = wire("u32")
    updates: int = wire("u32")
    p: tuple[int, ...] = wire("i32", _P)
    se: tuple[int, ...] = wire("i32", _P)
    correlation: tuple[int, ...] = wire("i32", _PAIRS)  # Q30, upper triangle by rows
    kappa: int = wire("i32")
    residual_sd: int = wire("i32")
    weight: int = wire("u32")
    reason: int = wire("u8")
    tick_high: int = wire("u16", absent=0)
    standing: int = wire("u32", absent=NO_STANDING)

    FULL_KAPPA: ClassVar[float] = 2.0**30

    def in_si(self, units: Float, zero: float) -> tuple[Float, Float]:
        """p [places] and its covariance of a board with these units of p; `zero` [rad] is added to c."""
        of_each = np.full(self.places, np.nan)
        of_each[: len(units)] = units[: self.places]
        se, p = np.array(self.se) * of_each, np.array(self.p) * of_each
        p[3] += zero
        return p, _symmetric(self.correlation, self.places) / 2**30 * np.outer(se, se)


@dataclass(frozen=True)
class Status(Message):
    """Board to PC: what it does, and what its receiver lost."""

    TYPE = 7
    session: int = wire("u32")
    code: int = wire("u8")
    core: int = wire("u8")  # pvid_status of the init
    updates: int = wire("u32")
    rejected: int = wire("u32")  # samples that were not finite or absurd
    repeated: int = wire("u32")  # samples that had come before
    skipped: int = wire("u32")  # sample frames that were not the next ones
    missing: int = wire("u32")  # pvid_link_counters of the board's decoder
    malformed: int = wire("u32")
    bad_crc: int = wire("u32")
    foreign: int = wire("u32")
    tick_high: int = wire("u16", absent=0)


@dataclass(frozen=True)
class Hash(Message):
    """Board to PC: the running hashes (FNV-1a, 32 bits) after the header's tick.

    `hash` covers what the identifier made of the samples (fnv.h), `sample_hash` the samples themselves: the bytes of
    each tick, as they stand in a frame, since the session began. 0: the board does not compute it.
    """

    TYPE = 8
    session: int = wire("u32")
    hash: int = wire("u32")
    tick_high: int = wire("u16", absent=0)
    sample_hash: int = wire("u32", absent=0)


@dataclass(frozen=True)
class Credit(Message):
    """Board to PC: all samples before the header's tick are processed, `room` more may be sent; PC to board: say
    so again, with hello and status."""

    TYPE = 9
    session: int = wire("u32")
    room: int = wire("u32")
    hash: int = wire("u32")  # running, after that tick, as in Hash
    reason: int = wire("u8")  # of the last tick
    tick_high: int = wire("u16", absent=0)
    sample_hash: int = wire("u32", absent=0)


MESSAGES.pop(0)


def schema_text(messages: Mapping[int, type[Message]], places: int = PLACES) -> str:
    """What `parse_schema` reads; its CRC-32 stands in the header of every frame."""
    return "\n".join([f"pvid {VERSION}", *(messages[number].layout(places).text for number in sorted(messages))])


LAYOUTS = {number: MESSAGES[number].layout() for number in sorted(MESSAGES)}
SCHEMA_TEXT = schema_text(MESSAGES)
SCHEMA = zlib.crc32(SCHEMA_TEXT.encode())
WIDE_SCHEMA_TEXT = schema_text(MESSAGES, WIDE)
WIDE_SCHEMA = zlib.crc32(WIDE_SCHEMA_TEXT.encode())


_NAME = "[A-Za-z_][A-Za-z0-9_]{0,31}"
_SCHEMA_HEAD = re.compile(r"pvid [0-9]{1,9}")
_SCHEMA_LINE = re.compile(rf"([0-9]{{1,3}}) ({_NAME})((?: {_NAME}:[a-z0-9]+(?:\[[0-9]{{0,4}}\])?)+)")
_SCHEMA_FIELD = re.compile(rf"({_NAME}):({'|'.join(_WIRE)})(?:\[([0-9]*)\])?")


def parse_schema(text: str) -> dict[int, Layout]:
    """Layouts by type of a schema text, of this version of pvid or another.

    The text comes over the line: one that describes no payload a frame can hold is refused.

    Raises PvidError when it is not one.
    """
    head, *lines = text.split("\n")
    if not _SCHEMA_HEAD.fullmatch(head):
        raise PvidError(f"no schema of pvid: it begins with {shown(head)}")
    layouts: dict[int, Layout] = {}
    for line in lines:
        layout = _layout(line)
        if layout.type in layouts:
            raise PvidError(f"a schema that describes frame type {layout.type} twice")
        layouts[layout.type] = layout
    return layouts


def _layout(line: str) -> Layout:
    """Of one line of a schema text."""
    match = _SCHEMA_LINE.fullmatch(line)
    fields_of = [] if match is None else [_SCHEMA_FIELD.fullmatch(word) for word in match[3].split()]
    if match is None or not all(fields_of) or int(match[1]) > 0xFF:
        raise PvidError(f"no line of a schema: {shown(line, 80)}")
    described: list[tuple[str, str, int | None]] = []
    for found in fields_of:
        assert found is not None
        name, kind, count = found.groups()
        described.append((name, kind, 1 if count is None else int(count) if count else None))
    layout = Layout(int(match[1]), match[2], tuple(described))
    if any(count == 0 for _, _, count in described) or layout.size > MAX_PAYLOAD:
        raise PvidError(f"no payload of a frame: {shown(line, 80)} has an array of 0, or more than {MAX_PAYLOAD} bytes")
    if any(count is None for _, _, count in described[:-1]):
        raise PvidError(f"no payload of a frame: in {shown(line, 80)} only the last field may be open-ended")
    if len({name for name, _, _ in described}) < len(described) or len(described) > MAX_FIELDS:
        raise PvidError(f"no payload of a frame: {shown(line, 80)} names a field twice, or more than {MAX_FIELDS}")
    return layout


@dataclass(frozen=True)
class Described(Message, messages={}):
    """A payload that only a schema text describes: of another version of pvid. `kind` is the frame's name there."""

    kind: str
    values: dict[str, Any]


# The message of a payload by frame type; each raises PvidError where the payload has not its layout.
Readers = Mapping[int, Callable[[bytes], Message]]


def readers(messages: Mapping[int, type[Message]], places: int = PLACES) -> Readers:
    """What a decoder reads these messages with."""
    return {number: partial(kind.of, places=places) for number, kind in messages.items()}


def of_boards() -> dict[int, Readers]:
    """Of boards with few parameters and with many, by schema."""
    return {SCHEMA: readers(MESSAGES), WIDE_SCHEMA: readers(MESSAGES, WIDE)}


def _extends(layout: Layout, today: Layout, absent: Mapping[str, int]) -> bool:
    """Whether a message of `today` differs from that layout in no more than fields that have a value where absent."""
    kept = tuple(one for one in today.fields if one[0] not in absent or one in layout.fields)
    return (layout.name, layout.fields) == (today.name, kept)


# Frames that had other fields when a tick had two samples and a mechanism at most six parameters.
_OF_TWO_SAMPLES = """\
pvid 1
1 hello form:u8 core:u8 n_p:u8 window:u16 settings:u32 session:u32 sample_rate:f32 phi_lsb:f32 y_lsb:f32 \
p_unit:f32[6] board:char[16] tick_high:u16
3 configure session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 law:u8 \
start:f32[6] start_sd:f32[6] lower:f32[6] upper:f32[6] row_sd:f32 forgetting_s:f32 feedback_hz:f32 first_tick:u64
4 sample phi_y:f32[]
5 raw session:u32 tick_high:u16 phi_y:f32[]
6 estimate session:u32 updates:u32 p:f32[6] covariance:f32[21] kappa:f32 residual_sd:f32 weight:f32 reason:u8 \
tick_high:u16
10 configure_q31 session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 \
start:i32[6] start_sd:i32[6] lower:i32[6] upper:i32[6] row_sd:i32 forgetting_groups:u32 gain:i32 phi_offset:i32 \
y_offset:i32 first_tick:u64
11 count phi_y:i32[]
12 raw_count session:u32 tick_high:u16 phi_y:i32[]
13 estimate_q31 session:u32 updates:u32 p:i32[6] se:i32[6] correlation:i32[21] kappa:i32 residual_sd:i32 weight:u32 \
reason:u8 tick_high:u16"""
_FORMER = parse_schema(_OF_TWO_SAMPLES)
_FORMER_P = 6


def _of_two_samples(kind: type[Message], values: Mapping[str, Any]) -> Message:
    """The message of today of a frame as it was then."""
    counts = {f.name: f.metadata["count"] for f in fields(kind)}
    found: dict[str, Any] = {}
    for name, value in values.items():
        wanted = counts.get(name)
        if name == "phi_y":
            found["data"] = value
        elif wanted == _P:
            found[name] = in_places(value)
        elif wanted == _PAIRS:
            matrix = np.zeros((_FORMER_P, _FORMER_P), np.asarray(value).dtype)
            matrix[np.triu_indices(_FORMER_P)] = value
            found[name] = upper_triangle(matrix)
        else:
            found[name] = value
    return kind(**found)


def described_readers(text: str) -> Readers:
    """What a decoder reads frames with that `text` describes: a message of today where the layout is the same, or was
    before fields were added that may be absent, or more samples and parameters.

    Raises PvidError when it is no schema.
    """

    def reader(layout: Layout) -> Callable[[bytes], Message]:
        known = MESSAGES.get(layout.type)
        of_today = () if known is None else (known.layout(PLACES), known.layout(WIDE))
        if known is not None and any(_extends(layout, today, known.absent()) for today in of_today):
            return lambda payload: known(**layout.unpack(payload))
        former = _FORMER.get(layout.type)
        if known is not None and former is not None and _extends(layout, former, known.absent()):
            return lambda payload: _of_two_samples(known, layout.unpack(payload))
        return lambda payload: Described(layout.name, layout.unpack(payload))

    return {number: reader(layout) for number, layout in parse_schema(text).items()}


@dataclass(frozen=True)
class Frame:
    """A frame that came through; `tick` with its upper bits where the message has them."""

    sequence: int
    tick: int
    message: Message
    schema: int = SCHEMA


@dataclass(frozen=True)
class Loss:
    """What did not: `why` is malformed, crc, foreign, layout, or sequence, of which `frames` are missing.

    `pieces` between two zeros, `bytes` together;  `schema` is that of the frame behind a gap in the sequence.
    """

    why: str
    frames: int = 0
    bytes: int = 0
    pieces: int = 1
    schema: int = field(default=SCHEMA, compare=False)


@dataclass
class Counters:
    """What a decoder has seen; `missing` counts frames, the others pieces between two zeros."""

    frames: int = 0
    missing: int = 0
    malformed: int = 0
    crc: int = 0
    foreign: int = 0
    layout: int = 0

    @property
    def damaged(self) -> int:
        """Pieces that were no frame."""
        return self.malformed + self.crc + self.layout


def encode(message: Message, sequence: int, tick: int = 0, schema: int | None = None) -> bytes:
    """A frame with its final 0x00; sequence modulo 2^16; `schema` None: by the message's places, and a board with many
    parameters takes frames without them of both. Of a tick beyond 32 bits the message takes the upper ones."""
    if tick > 0xFFFFFFFF and hasattr(message, "tick_high"):
        high: dict[str, Any] = {"tick_high": tick >> 32}
        message = replace(message, **high)
    own = SCHEMA if message.places == PLACES else WIDE_SCHEMA
    return encode_raw(message.TYPE, sequence, tick, message.payload, own if schema is None else schema)


def encode_raw(number: int, sequence: int, tick: int, payload: bytes, schema: int = SCHEMA) -> bytes:
    """A frame with any payload of at most MAX_PAYLOAD bytes."""
    if len(payload) > MAX_PAYLOAD:
        raise PvidError(f"a payload of {len(payload)} bytes, and a frame holds {MAX_PAYLOAD}")
    raw = _HEADER.pack(VERSION, number, schema, sequence & 0xFFFF, tick & 0xFFFFFFFF) + payload
    return bytes(cobs.encode(raw + _CRC.pack(zlib.crc32(raw)))) + b"\0"


@dataclass
class Decoder:
    """Bytes in, frames and losses out; never raises and never holds more than one frame.

    `schemas` contains the known schemas, frames of others are foreign; sequences are followed for each on its
    own. With `learns` a foreign Schema frame whose text has the CRC-32 of its own header adds to them, for as long as
    no MAX_LEARNT others have come after it.
    """

    counters: Counters = field(default_factory=Counters)
    schemas: dict[int, Readers] = field(default_factory=of_boards)
    learns: bool = False
    _pending: bytearray = field(default_factory=bytearray)
    _overflow: int = 0
    _amidst: bool = False  # in a frame of which the beginning was left out
    _expected: dict[int, int] = field(default_factory=dict)
    _learnt: deque[int] = field(default_factory=deque)

    def feed(self, data: bytes) -> list[Frame | Loss]:
        """What these bytes completed, in order."""
        return list(self.items(data))

    def items(self, data: bytes) -> Iterator[Frame | Loss]:
        """Like `feed`, each decoded only when it is requested; to be exhausted before the next call."""
        for piece in self._pieces(data):
            yield from self._judge(*piece)

    def expect_anew(self, schema: int) -> None:
        """Another sender begins: the next frame of this schema is the start of its sequence."""
        self._expected.pop(schema, None)

    def lose_place(self) -> None:
        """Bytes are left out here: reading goes on behind the next 0x00, and sequences begin anew."""
        self._pending.clear()
        self._overflow = 0
        self._expected.clear()
        self._amidst = True

    @property
    def unfinished(self) -> int:
        """Bytes since the last 0x00."""
        return len(self._pending) + self._overflow

    def _pieces(self, data: bytes) -> Iterator[tuple[bytes, int]]:
        """What stands between two zeros, and how many bytes of it were too many to be kept."""
        *ended, rest = data.split(b"\0")
        for part in ended:
            self._keep(part)
            if (self._pending or self._overflow) and not self._amidst:
                yield bytes(self._pending), self._overflow
            self._pending.clear()
            self._overflow = 0
            self._amidst = False
        self._keep(rest)

    def _keep(self, part: bytes) -> None:
        room = LONGEST_FRAME - len(self._pending)
        self._pending += part[:room]
        self._overflow += len(part[room:])

    def _judge(self, piece: bytes, overflow: int) -> Iterator[Frame | Loss]:
        try:
            raw = b"" if overflow else bytes(cobs.decode(piece))
        except cobs.DecodeError:
            raw = b""
        if not _HEADER.size + _CRC.size <= len(raw) <= _LONGEST:
            yield self._lost("malformed", piece, overflow)
            return
        body = raw[: -_CRC.size]
        if zlib.crc32(body) != _CRC.unpack(raw[-_CRC.size :])[0]:
            yield self._lost("crc", piece)
            return
        version, number, schema, sequence, tick = _HEADER.unpack_from(body)
        payload = body[_HEADER.size :]
        if self.learns and number == Schema.TYPE and zlib.crc32(payload) == schema:
            self.learn(payload)
        if version != VERSION or schema not in self.schemas:
            yield self._lost("foreign", piece)
            return
        yield from self._gap(schema, sequence)
        try:
            message = self.schemas[schema][number](payload)
        except Exception:  # whatever a reader stumbles over is in the bytes, and they are the line's
            yield self._lost("layout", piece)
            return
        self.counters.frames += 1
        yield Frame(sequence, tick | getattr(message, "tick_high", 0) << 32, message, schema)

    def learn(self, text: bytes) -> None:
        """Frames of the schema with this text come through from here on, if it is one; the oldest learnt one goes."""
        schema = zlib.crc32(text)
        if schema in self.schemas:
            return
        try:
            found = described_readers(text.decode("ascii"))
        except (PvidError, UnicodeDecodeError):
            return
        self.schemas[schema] = found
        self._learnt.append(schema)
        if len(self._learnt) > MAX_LEARNT:
            oldest = self._learnt.popleft()
            del self.schemas[oldest]
            self.expect_anew(oldest)

    def _lost(self, why: str, piece: bytes, overflow: int = 0) -> Loss:
        setattr(self.counters, why, getattr(self.counters, why) + 1)
        return Loss(why, bytes=len(piece) + overflow)

    def _gap(self, schema: int, sequence: int) -> Iterator[Loss]:
        ahead = (sequence - self._expected.get(schema, sequence)) & 0xFFFF
        self._expected[schema] = (sequence + 1) & 0xFFFF
        if 0 < ahead < 0x8000:  # else the sender has restarted
            self.counters.missing += ahead
            yield Loss("sequence", frames=ahead, schema=schema)


def c_header() -> str:
    """firmware/link/schema.h."""

    def of_both(narrow: str, wide: str) -> str:
        return narrow if narrow == wide else f"PVID_LINK_PLACES({narrow}, {wide})"

    both = zip(SCHEMA_TEXT.split("\n"), WIDE_SCHEMA_TEXT.split("\n"), strict=True)
    text = [of_both(f'"{narrow}\\n"', f'"{wide}\\n"') for narrow, wide in both]
    text[-1] = text[-1].replace("\\n", "")
    lines = [
        "/* Made by `pvid schema`: do not edit. The fields are explained in host/src/pvid/link/frames.py. */",
        "#ifndef PVID_SCHEMA_H",
        "#define PVID_SCHEMA_H",
        "",
        '#include "pvid/config.h"',
        "",
        "/* Places for parameters in a frame, and what depends on them. */",
        f"#if PVID_MAX_P > {PLACES}",
        "#define PVID_LINK_PLACES(narrow, wide) wide",
        "#else",
        "#define PVID_LINK_PLACES(narrow, wide) narrow",
        "#endif",
        f"#define PVID_LINK_P PVID_LINK_PLACES({PLACES}u, {WIDE}u)",
        "",
        f"#define PVID_LINK_VERSION {VERSION}u",
        "",
        "/* CRC-32 of the text. Frames without parameters are the same in both. */",
        f"#define PVID_LINK_NARROW_SCHEMA 0x{SCHEMA:08X}u",
        f"#define PVID_LINK_SCHEMA PVID_LINK_PLACES(PVID_LINK_NARROW_SCHEMA, 0x{WIDE_SCHEMA:08X}u)",
        "",
        "#define PVID_LINK_SCHEMA_TEXT \\",
        " \\\n".join(f"    {line}" for line in text),
        "",
        "/* Frame types; offsets of their fields and the bytes before an open end. */",
    ]
    for layout in LAYOUTS.values():
        stem = f"PVID_{layout.name.upper()}"
        lines += ["", f"#define {stem} {layout.type}u"]
        wide = MESSAGES[layout.type].layout(WIDE)
        at = wide_at = 0
        for (name, kind, count), (_, _, more) in zip(layout.fields, wide.fields, strict=True):
            extent = "" if count == 1 else f"[{count or ''}]" if count == more else f"[{count} or {more}]"
            lines.append(f"#define {stem}_{name.upper()} {of_both(f'{at}u', f'{wide_at}u')} /* {kind}{extent} */")
            at += _WIRE[kind][1] * (count or 0)
            wide_at += _WIRE[kind][1] * (more or 0)
        lines.append(f"#define {stem}_BYTES {of_both(f'{layout.size}u', f'{wide.size}u')}")
    for title, enum in (
        ("Status.code", Code),
        ("Hello.form", Form),
        ("Hello.core", Core),
        ("Configure.source", Source),
    ):
        lines += ["", f"/* {title} */"]
        lines += [f"#define PVID_{enum.__name__.upper()}_{member.name} {member.value}u" for member in enum]
    return "\n".join([*lines, "", "#endif", ""])
