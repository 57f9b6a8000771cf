"""What a lying board does: every behaviour is a function that yields what it sends, in order.

Most are honest first: what was recorded before the lie must be readable whatever comes after it.
"""

from __future__ import annotations

import math
import random
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cobs import cobs

from bench.liar_board import (
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
    MAX_P,
    MAX_PAYLOAD,
    SCHEMA,
    SCHEMA_TEXT,
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
)
from pvid.log import file as logfile
from pvid.log.file import LOG_SCHEMA, LOG_SCHEMA_TEXT

Steps = Iterator[Step]
NAN, INF, HUGE, TINY = math.nan, math.inf, 3e38, 1e-45
ABSURD = (NAN, INF, -INF, HUGE, -1.0, 0.0, TINY)
ESCAPES = "\x1b]0;PWN\x07\x1b[31m"
LARGEST = 2**31 - 1
_PAIRS = MAX_P * (MAX_P + 1) // 2  # of parameters


@dataclass(frozen=True)
class Behaviour:
    """One of BEHAVIOURS: `log` are the exit codes that `pvid log` may have at its end."""

    name: str
    log: tuple[int, ...]
    honest_first: bool
    steps: Callable[[LyingBoard], Steps]


BEHAVIOURS: dict[str, Behaviour] = {}


def _lie(*log: int, honest_first: bool = True) -> Callable[[Callable[[LyingBoard], Steps]], None]:
    """Enters a behaviour: an honest run, where it is wanted, and then the lie; exit code 0 where no other is named."""

    def enter(lie: Callable[[LyingBoard], Steps]) -> None:
        def steps(board: LyingBoard) -> Steps:
            if honest_first:
                yield board.honest()
            yield from lie(board)

        name = lie.__name__.strip("_").replace("_", " ")
        BEHAVIOURS[name] = Behaviour(name, log or (0,), honest_first, steps)

    return enter


# ---- for comparison


@_lie()
def _nothing_but_the_truth(board: LyingBoard) -> Steps:
    yield b""


# ---- schemas


@_lie()
def _schema_with_an_array_of_0(board: LyingBoard) -> Steps:
    for kind in ("u8", "f32", "char"):
        yield board.schema(f"pvid 1\n6 estimate p:{kind}[0] q:u8".encode(), (6, b"\1"))


@_lie()
def _schema_with_an_array_beyond_a_frame(board: LyingBoard) -> Steps:
    for count in ("2049", "9999", "9" * 300, "9" * 1900):
        yield board.schema(b"pvid 1\n6 estimate p:f32[%s]" % count.encode(), (6, bytes(8)))


@_lie()
def _schema_with_an_open_end_amid_it(board: LyingBoard) -> Steps:
    yield board.schema(b"pvid 1\n6 estimate p:f32[] q:u8[] r:u8", (6, bytes(9)), (6, b""))


@_lie()
def _schema_with_fields_of_one_name(board: LyingBoard) -> Steps:
    yield board.schema(b"pvid 1\n6 estimate kind:u8 values:u8 self:u8 self:u8", (6, bytes(4)))


@_lie()
def _schema_with_names_of_python(board: LyingBoard) -> Steps:
    yield board.schema(b"pvid 1\n6 __class__ kind:u8 values:u8 self:u8 __dict__:u8", (6, bytes(4)))


@_lie()
def _schema_with_digits_of_other_scripts(board: LyingBoard) -> Steps:
    yield board.schema("pvid 1\n² x a:u8".encode(), (2, b"\1"))
    yield board.schema(b"pvid 1\n\xb2 x a:u8", (2, b"\1"))
    yield board.schema("pvid ٣\n3 x a:u8[٣]".encode(), (3, b"\1"))
    yield board.schema(b"pvid 99999999999999999999999\n999999999999999999999999 x a:u8", (9, b"\1"))


@_lie(1)
def _schema_that_is_cut_short(board: LyingBoard) -> Steps:
    for end in range(0, len(SCHEMA_TEXT), 97):
        yield board.schema(SCHEMA_TEXT.encode()[:end], (6, b"\1"))
    for text in (b"pvid 1", b"pvid 1\n", b"pvid 1\n\n\n", b"pvid 1\n1", b"pvid 1\n1 a", b"pvid 1\n1 a ", b"\0\0"):
        yield board.schema(text, (1, b"\1"), (2, text))


@_lie()
def _schema_that_describes_a_type_twice(board: LyingBoard) -> Steps:
    yield board.schema(b"pvid 1\n6 a b:u8\n6 a b:f32", (6, b"\1"), (6, bytes(4)))


@_lie()
def _schema_of_500_fields(board: LyingBoard) -> Steps:
    text = b"pvid 1\n6 a " + b" ".join(b"%c%c:u8" % (97 + i // 26, 97 + i % 26) for i in range(330))
    yield board.schema(text, (6, bytes(330)))


@_lie()
def _schema_with_escapes_in_its_names(board: LyingBoard) -> Steps:
    yield board.schema(b"pvid 1\n1 a\x1b[31m b:u8", (1, b"\1"))
    yield board.schema(b"pvid 1\n1 a b\x1b]0;PWN\x07:u8", (1, b"\1"))
    yield board.schema(b"pvid 1\x1b[2J\n1 a b:u8", (1, b"\1"))


@_lie()
def _schema_under_a_number_that_is_not_its_own(board: LyingBoard) -> Steps:
    yield board.raw(Schema.TYPE, b"pvid 1\n6 estimate p:u8", 0, 12345)
    yield board.raw(6, b"\1", 0, 12345)


@_lie()
def _schema_of_today_with_other_types(board: LyingBoard) -> Steps:
    text = SCHEMA_TEXT.replace("6 estimate", "60 estimate").encode()
    yield board.schema(text, (60, board.estimate().payload), (6, board.estimate().payload))


@_lie()
def _schema_of_the_logger_s_frames(board: LyingBoard) -> Steps:
    yield board.schema(LOG_SCHEMA_TEXT.encode(), (240, message(logfile.Segment).payload))
    text = b"pvid 1\n" + b"\n".join(b"%d segment a:u8" % number for number in range(240, 245))
    yield board.schema(text, *((number, b"\1") for number in range(240, 245)))


@_lie()
def _schemas_without_end(board: LyingBoard) -> Steps:
    fields = b" ".join(b"a%d:u8" % i for i in range(12))
    front = b"pvid 1\n" + b"\n".join(b"%d k%d " % (i, i) + fields for i in range(1, 20))
    for i in range(500):
        yield board.schema(front + b"\n99 x%d a:u8" % i, (99, b"\1"))


@_lie()
def _kinds_without_end(board: LyingBoard) -> Steps:
    for i in range(60):
        lines = b"\n".join(b"%d kind_%d_%d a:u8" % (number, i, number) for number in range(1, 60))
        yield board.schema(b"pvid 1\n" + lines, *((number, b"\1") for number in range(1, 60)))


# ---- what it calls itself


@_lie()
def _a_name_of_escapes(board: LyingBoard) -> Steps:
    for _ in range(3):
        yield board.say(board.hello(board="\x1b]0;PWN\x07\x1b[31mX"))
        yield Pause(0.3)


@_lie()
def _a_name_of_html(board: LyingBoard) -> Steps:
    yield board.say(board.hello(board="<img src=x onerr"))
    yield board.say(board.hello(board="</script><b>"))


@_lie()
def _a_name_of_markup(board: LyingBoard) -> Steps:
    for name in ("[red]x[/]", "[/]", "[link=a:b]c", "$\\frac{1}{0$", "%s%n{0}", "=1+1", "a\r\nb\tc"):
        yield board.say(board.hello(board=name))
        yield Pause(0.3)


@_lie()
def _a_name_of_formulas(board: LyingBoard) -> Steps:
    yield board.say(board.hello(board="$\\frac{1}{0$"))


@_lie()
def _a_name_of_bytes_beyond_ascii(board: LyingBoard) -> Steps:
    payload = board.hello(board="N" * 16).payload
    name = b"\xff\xfe\xed\xa0\x80\xe2\x80\xae\x9b31m\0x\x7f"
    yield board.raw(Hello.TYPE, payload.replace(b"N" * 16, name.ljust(16)))


@_lie()
def _no_name(board: LyingBoard) -> Steps:
    yield board.say(board.hello(board=""))


@_lie(honest_first=False)
def _escapes_in_its_name_from_the_first_frame_on(board: LyingBoard) -> Steps:
    yield board.honest(board.hello(board=ESCAPES[:16]))


# ---- numbers of its Hello


def _hellos(board: LyingBoard, name: str, values: tuple[object, ...]) -> Steps:
    for value in values:
        board.sequence = 0
        yield board.honest(board.hello(**{name: value}))


@_lie(honest_first=False)
def _sample_rates_that_are_none(board: LyingBoard) -> Steps:
    yield from _hellos(board, "sample_rate", ABSURD)


@_lie(honest_first=False)
def _sample_rates_at_the_edge(board: LyingBoard) -> Steps:
    yield from _hellos(board, "sample_rate", (1e-38, 1e38, 1e-3, 1e9, 0.999e-3))


@_lie()
def _another_sample_rate_every_second(board: LyingBoard) -> Steps:
    for tick, rate in enumerate((1.0, 1e6, NAN, RATE), start=TICKS // PER_FRAME):
        yield board.say(board.hello(sample_rate=rate))
        yield board.say(board.samples(), tick * PER_FRAME)


@_lie(honest_first=False)
def _numbers_of_parameters(board: LyingBoard) -> Steps:
    yield from _hellos(board, "n_p", (0, 1, 5, 255))


@_lie(honest_first=False)
def _forms_and_cores_that_there_are_not(board: LyingBoard) -> Steps:
    yield from _hellos(board, "form", (3, 255))
    yield from _hellos(board, "core", (2, 255))


@_lie(honest_first=False)
def _the_other_form_and_the_other_core(board: LyingBoard) -> Steps:
    yield from _hellos(board, "form", (0, 1))
    yield from _hellos(board, "core", (1,))


@_lie(honest_first=False)
def _windows_of_none_and_of_all(board: LyingBoard) -> Steps:
    yield from _hellos(board, "window", (0, 65535))


@_lie(honest_first=False)
def _units_that_are_none(board: LyingBoard) -> Steps:
    yield from _hellos(board, "phi_lsb", ABSURD)
    yield from _hellos(board, "y_lsb", ABSURD)
    yield from _hellos(board, "p_unit", tuple((value,) * MAX_P for value in ABSURD))


@_lie(honest_first=False)
def _units_that_are_none_in_fixed_point(board: LyingBoard) -> Steps:
    for value in ABSURD:
        board.sequence = 0
        yield board.say(board.hello(core=1, phi_lsb=value, y_lsb=value, p_unit=(value,) * MAX_P))
        yield board.say(message(ConfigureQ31, session=SESSION, phi_offset=LARGEST))
        yield board.say(RawCount.of_values([LARGEST] * 9, [-LARGEST] * 9))
        yield board.say(message(EstimateQ31, session=SESSION, p=(LARGEST,) * MAX_P, se=(-1,) * MAX_P), 9)


@_lie(honest_first=False)
def _sessions_that_never_begin(board: LyingBoard) -> Steps:
    for _ in range(4):
        yield board.say(board.hello(session=0))
        yield board.say(board.status(session=0, code=0))
        yield Pause(0.5)


@_lie()
def _another_session_in_every_frame(board: LyingBoard) -> Steps:
    for i in range(300):
        yield board.say(board.hello(session=i))
        yield board.say(message(Hash, session=2**32 - 1 - i), TICKS + i)


@_lie(honest_first=False)
def _settings_of_another_image(board: LyingBoard) -> Steps:
    yield board.honest(board.hello(settings=1), board.configure(settings=1))


# ---- its configuration


def _configurations(board: LyingBoard, name: str, values: tuple[object, ...]) -> Steps:
    for value in values:
        board.sequence = 0
        yield board.honest(configure=board.configure(**{name: value}))


@_lie(honest_first=False)
def _row_sd_that_is_none(board: LyingBoard) -> Steps:
    yield from _configurations(board, "row_sd", ABSURD)


@_lie(honest_first=False)
def _laws_that_there_are_not(board: LyingBoard) -> Steps:
    yield from _configurations(board, "law", (2, 200, 255))


@_lie(honest_first=False)
def _dividers_of_none_and_of_all(board: LyingBoard) -> Steps:
    yield from _configurations(board, "divider", (0, 65535))


@_lie(honest_first=False)
def _starts_that_are_none(board: LyingBoard) -> Steps:
    yield from _configurations(board, "start", tuple((value,) * MAX_P for value in ABSURD))


@_lie(honest_first=False)
def _standard_deviations_that_are_none(board: LyingBoard) -> Steps:
    yield from _configurations(board, "start_sd", tuple((value,) * MAX_P for value in ABSURD))


@_lie(honest_first=False)
def _limits_that_are_none(board: LyingBoard) -> Steps:
    yield from _configurations(board, "lower", tuple((value,) * MAX_P for value in (NAN, INF, HUGE)))
    yield from _configurations(board, "upper", tuple((value,) * MAX_P for value in (NAN, -INF, 0.0)))


@_lie(honest_first=False)
def _memories_and_feedbacks_that_are_none(board: LyingBoard) -> Steps:
    yield from _configurations(board, "forgetting_s", ABSURD)
    yield from _configurations(board, "feedback_hz", ABSURD)


@_lie(honest_first=False)
def _sources_and_forms_that_there_are_not(board: LyingBoard) -> Steps:
    yield from _configurations(board, "source", (3, 255))
    yield from _configurations(board, "form", (0, 7))
    yield from _configurations(board, "hash_every", (0,))


@_lie(honest_first=False)
def _the_configuration_of_the_other_core(board: LyingBoard) -> Steps:
    yield board.say(board.hello())
    yield board.say(message(ConfigureQ31, session=SESSION, settings=board.hello().settings, row_sd=-1))
    yield board.say(RawCount.of_values([1] * 9, [1] * 9), 0)
    yield board.say(message(Hash, session=SESSION), 9)
    yield board.honest()
    yield board.say(message(EstimateQ31, session=SESSION, updates=1), TICKS)


@_lie()
def _configurations_without_end(board: LyingBoard) -> Steps:
    for i in range(2000):
        yield board.say(board.configure(session=i + 1))


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


@_lie(honest_first=False)
def _names_that_are_none_and_names_of_others(board: LyingBoard) -> Steps:
    for number, text in enumerate(NAMED):
        yield board.say(message(Names, text=text))
        yield board.say(board.samples(), number * PER_FRAME)
        yield board.say(board.estimate(), (number + 1) * PER_FRAME)


@_lie(honest_first=False)
def _another_mechanism_all_the_time(board: LyingBoard) -> Steps:
    for number in range(300):
        yield board.say(message(Names, text=b"m%d\nsample s%d V\np p%d ohm" % (number, number, number)))
        yield board.say(board.samples(), number * PER_FRAME)
        yield board.say(board.estimate(), (number + 1) * PER_FRAME)


@_lie(1, honest_first=False)
def _samples_of_any_number_a_tick(board: LyingBoard) -> Steps:
    for number in range(256):
        payload = bytes([7, 0, 0, 0, 0, 0, number]) + b"\0" * (4 * PER_FRAME)
        yield board.raw(Raw.TYPE, payload, number * PER_FRAME)
    yield from _hellos(board, "samples", (0, 1, 3, 8, 9, 255))


# ---- estimates, hashes, credits


@_lie()
def _estimates_that_are_no_numbers(board: LyingBoard) -> Steps:
    for p in (*ABSURD, 1e30):
        for variance in (*ABSURD, 1e30):
            told = {"p": (p,) * MAX_P, "covariance": (variance,) * _PAIRS}
            yield board.say(board.estimate(**told), TICKS)
            yield board.say(board.estimate(**told, kappa=NAN, residual_sd=INF, weight=-1.0), TICKS)


@_lie()
def _kappas_and_residuals_that_are_none(board: LyingBoard) -> Steps:
    for value in ABSURD:
        yield board.say(board.estimate(kappa=value), TICKS)
        yield board.say(board.estimate(residual_sd=value), TICKS)
        yield board.say(board.estimate(weight=value), TICKS)


@_lie()
def _reasons_that_there_are_not(board: LyingBoard) -> Steps:
    for reason in range(256):
        yield board.say(board.estimate(reason=reason), TICKS)


@_lie()
def _estimates_beyond_physics(board: LyingBoard) -> Steps:
    for p in ((31.0, 8.0, 7.0), (-31.0, 8.0, 5.0), (31.0, 0.0, 0.0), (1e-30, 1.0, 1.0), (1e30, 1e30, -1e30)):
        yield board.say(board.estimate(p=(*p, *[0.0] * (MAX_P - 3))), TICKS)


@_lie()
def _estimates_of_the_other_core(board: LyingBoard) -> Steps:
    for value in (0, LARGEST, -LARGEST - 1):
        told = {name: (value,) * MAX_P for name in ("p", "se")}
        yield board.say(
            message(EstimateQ31, **told, correlation=(value,) * _PAIRS, kappa=value, residual_sd=value), TICKS
        )


@_lie()
def _estimates_of_ticks_that_never_were(board: LyingBoard) -> Steps:
    for tick in (0, 1, TICKS - 1, TICKS + 1, 10**6, 2**31, 2**32 - 1):
        yield board.say(board.estimate(), tick)


@_lie()
def _counters_at_their_end(board: LyingBoard) -> Steps:
    yield board.say(board.estimate(updates=2**32 - 1), TICKS)
    names = ("updates", "rejected", "repeated", "skipped", "missing", "malformed", "bad_crc", "foreign")
    yield board.say(board.status(**dict.fromkeys(names, 2**32 - 1)))


@_lie()
def _a_false_hash(board: LyingBoard) -> Steps:
    yield board.say(message(Hash, session=SESSION, hash=1), TICKS)


@_lie()
def _a_hash_for_every_tick(board: LyingBoard) -> Steps:
    for tick in range(TICKS + 5):
        yield board.say(message(Hash, session=SESSION, hash=tick), tick)


@_lie()
def _credits_that_nobody_asked_for(board: LyingBoard) -> Steps:
    for tick in (0, TICKS, 2**32 - 1):
        yield board.say(message(Credit, session=SESSION, room=2**32 - 1, hash=1, reason=255), tick)


# ---- samples


@_lie()
def _samples_that_are_no_numbers(board: LyingBoard) -> Steps:
    for i, value in enumerate(ABSURD):
        yield board.say(board.samples(value, value), TICKS + i * PER_FRAME)


@_lie()
def _samples_of_the_other_core(board: LyingBoard) -> Steps:
    yield board.say(RawCount.of_values([LARGEST] * 9, [-LARGEST] * 9), TICKS)
    yield board.say(board.samples(), TICKS + 9)


@_lie(1)
def _sample_frames_of_odd_lengths(board: LyingBoard) -> Steps:
    for length in (0, 1, 7, 8, 12, 2047, 2048):
        yield board.raw(Raw.TYPE, bytes(length), TICKS)


@_lie(honest_first=False)
def _a_sensor_that_stands_still(board: LyingBoard) -> Steps:
    yield from board.introduction()
    for tick in range(0, 2000, PER_FRAME):
        yield board.say(board.samples(), tick)
    yield board.say(board.estimate(), 2000)


@_lie(honest_first=False)
def _samples_that_are_all_zero(board: LyingBoard) -> Steps:
    yield from board.introduction()
    for tick in range(0, 2000, PER_FRAME):
        yield board.say(board.samples(0.0, 0.0), tick)
    yield board.say(board.estimate(), 2000)


@_lie()
def _one_sample_a_frame(board: LyingBoard) -> Steps:
    for tick in range(TICKS, TICKS + 3000):
        yield board.say(board.samples(count=1), tick)


@_lie()
def _nothing_but_empty_sample_frames(board: LyingBoard) -> Steps:
    for _ in range(3000):
        yield board.say(Raw(b""), TICKS)


@_lie(1)
def _ticks_that_jump(board: LyingBoard) -> Steps:
    for tick in (5000, 10**6, 2**31, 0, 2**32 - 1, 100, 99, 98):
        yield board.say(board.samples(), tick)
        yield board.say(board.estimate(), tick)
        yield board.say(message(Hash, session=SESSION, hash=1), tick)


@_lie(1)
def _ticks_that_run_backwards(board: LyingBoard) -> Steps:
    for tick in range(TICKS - PER_FRAME, -1, -PER_FRAME):
        yield board.say(board.samples(), tick)


@_lie(honest_first=False)
def _ticks_at_the_end_of_32_bits(board: LyingBoard) -> Steps:
    yield from board.introduction()
    for i in range(100):
        yield board.say(board.samples(), (2**32 - 1000 + i * PER_FRAME) % 2**32)


@_lie()
def _the_same_samples_again_and_again(board: LyingBoard) -> Steps:
    frames = [link.encode(board.samples(), i, PER_FRAME * i) for i in range(40)]
    for _ in range(20):
        yield b"".join(frames)


@_lie()
def _a_start_at_every_moment(board: LyingBoard) -> Steps:
    for _ in range(100):
        board.sequence = 0
        yield board.say(board.hello())
        yield board.say(board.samples(), 0)


# ---- what it does


@_lie()
def _a_refusal_after_it_has_run(board: LyingBoard) -> Steps:
    for code in (0, 2, 3, 4, 5, 6, 7, 255):
        yield board.say(board.hello(session=0))
        yield board.say(board.status(code=code, core=255))
        yield Pause(0.1)


@_lie(honest_first=False)
def _every_code_of_a_status(board: LyingBoard) -> Steps:
    yield board.say(board.hello())
    for code in range(256):
        yield board.say(board.status(code=code, core=255 - code))


@_lie()
def _frames_that_only_the_pc_sends(board: LyingBoard) -> Steps:
    yield board.say(link.Sample.of_values([1.0], [2.0]), TICKS)
    yield board.say(link.Count.of_values([1], [2]), TICKS)


# ---- frames of the logger's own kind


def _forged(board: LyingBoard, *frames: logfile.Segment | logfile.Mark | logfile.Close | logfile.Rig) -> Steps:
    for tick in (0, 1, 2**32 - 1):
        for frame in frames:
            yield board.say(frame, tick, LOG_SCHEMA)


@_lie()
def _segments_of_the_logger(board: LyingBoard) -> Steps:
    for about in (b"{}", b'{"port": "\\ud800\\u001b[31mX"}', b'{"port": 5}', b"[" * 1900, b'{"port":' + b"[" * 1900):
        yield from _forged(board, message(logfile.Segment, number=99, unix_ns=2**64 - 1, about=about))


@_lie()
def _times_of_the_logger(board: LyingBoard) -> Steps:
    yield from _forged(board, *(logfile.Mark(when, when) for when in (0, 1, 2**63, 2**64 - 1)))


@_lie(1)
def _ends_of_the_logger(board: LyingBoard) -> Steps:
    yield from _forged(board, logfile.Close(2**64 - 1, 5, b"\x1b]0;PWN\x07\x1b[31mbye\xff"), logfile.Close(0, 0, b""))
    yield board.say(board.samples(), TICKS)


@_lie()
def _rig_files_of_the_logger(board: LyingBoard) -> Steps:
    yield from _forged(board, logfile.Rig(0, 8, b"l1 = 9.9"), logfile.Rig(0, 2**32 - 1, b"x" * 2000))


@_lie()
def _schemas_of_the_logger(board: LyingBoard) -> Steps:
    yield board.say(logfile.LinkSchema(b"pvid 1\n6 e p:u8[0]"), 0, LOG_SCHEMA)
    yield board.say(message(Schema, text=LOG_SCHEMA_TEXT.encode()), 0, LOG_SCHEMA)


@_lie()
def _segments_of_the_logger_without_end(board: LyingBoard) -> Steps:
    forged = b"".join(board.say(logfile.Segment(i, 1, b"{}"), 0, LOG_SCHEMA) for i in range(1000))
    for _ in range(5):
        yield forged


@_lie(honest_first=False)
def _a_log_of_the_logger_from_its_first_byte_on(board: LyingBoard) -> Steps:
    yield board.say(message(Schema, text=LOG_SCHEMA_TEXT.encode()), 77, LOG_SCHEMA)
    yield board.say(logfile.Segment(0, 1, b'{"port": "elsewhere"}'), 77, LOG_SCHEMA)
    yield board.say(logfile.Rig(0, 8, b"l1 = 9.9"), 77, LOG_SCHEMA)
    yield board.honest()
    yield board.say(logfile.Close(2, 2, b"the end"), 77, LOG_SCHEMA)


@_lie(1)
def _frames_of_the_logger_with_no_layout(board: LyingBoard) -> Steps:
    for number in (0, 2, 240, 241, 242, 243, 244, 245, 255):
        for length in (0, 3, 2048):
            yield board.raw(number, bytes(length), 0, LOG_SCHEMA)


# ---- the line


@_lie(1, honest_first=False)
def _nothing_but_noise(board: LyingBoard) -> Steps:
    noise = random.Random(1)
    for _ in range(20):
        yield noise.randbytes(1100)
        yield Pause(0.05)


@_lie(1, honest_first=False)
def _nothing_but_text(board: LyingBoard) -> Steps:
    for _ in range(300):
        yield b"\x1b[2J\x1b]0;PWN\x07boot: hello <script>alert(1)</script>\r\n"


@_lie(1, honest_first=False)
def _a_line_of_text_and_silence(board: LyingBoard) -> Steps:
    yield b"hello\r\n"
    yield Pause(0.5)


@_lie(1, honest_first=False)
def _nothing_but_zeros(board: LyingBoard) -> Steps:
    yield bytes(100_000)


@_lie(1, honest_first=False)
def _nothing_but_ones(board: LyingBoard) -> Steps:
    yield b"\xff" * 100_000


@_lie(1, honest_first=False)
def _frames_of_a_schema_that_nobody_knows(board: LyingBoard) -> Steps:
    for i in range(100):
        yield board.raw(5, bytes(100), i, 12345)


@_lie(1, honest_first=False)
def _frames_of_another_version_of_the_link(board: LyingBoard) -> Steps:
    for i in range(100):
        raw = struct.pack("<BBIHI", 2, 5, SCHEMA, i, i) + bytes(80)
        yield bytes(cobs.encode(raw + struct.pack("<I", zlib.crc32(raw)))) + b"\0"


@_lie(1)
def _frames_that_are_cut_short(board: LyingBoard) -> Steps:
    cut = random.Random(1)
    for i in range(300):
        frame = board.say(board.samples(), TICKS + PER_FRAME * i)
        yield frame[: cut.randrange(len(frame) + 1)]


@_lie(1)
def _frames_with_a_wrong_crc(board: LyingBoard) -> Steps:
    for i in range(100):
        frame = bytearray(board.say(board.samples(), TICKS + PER_FRAME * i))
        frame[40] = frame[40] % 255 + 1
        yield bytes(frame)


@_lie()
def _frames_of_the_longest_payload(board: LyingBoard) -> Steps:
    longest = (MAX_PAYLOAD - len(Raw(b"").payload)) // 8  # ticks of two samples
    for tick in range(TICKS, TICKS + 20 * longest, longest):
        yield board.say(board.samples(count=longest), tick)


@_lie(1)
def _frames_that_never_end(board: LyingBoard) -> Steps:
    yield b"\x01" * 3_000_000


@_lie(1)
def _frames_of_types_that_there_are_not(board: LyingBoard) -> Steps:
    for number in range(256):
        yield board.raw(number, bytes(7), TICKS)


@_lie(1)
def _sequence_numbers_at_random(board: LyingBoard) -> Steps:
    number = random.Random(1)
    for tick in range(TICKS, TICKS + 100 * PER_FRAME, PER_FRAME):
        board.sequence = number.randrange(1 << 16)
        yield board.say(board.samples(), tick)


@_lie(honest_first=False)
def _silence(board: LyingBoard) -> Steps:
    yield Pause(0.5)


@_lie()
def _a_stall_amid_a_frame(board: LyingBoard) -> Steps:
    frame = board.say(board.estimate(), TICKS)
    yield frame[:20]
    yield Pause(1.5)
    yield frame[20:]


@_lie()
def _a_line_that_is_hung_up_amid_a_frame(board: LyingBoard) -> Steps:
    for tick in range(TICKS, TICKS + 3 * PER_FRAME, PER_FRAME):
        yield board.say(board.samples(), tick)[:50]
        yield HangUp()


@_lie()
def _a_line_that_is_hung_up_at_once_again_and_again(board: LyingBoard) -> Steps:
    for _ in range(3):
        yield HangUp()


# ---- floods


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_noise(board: LyingBoard) -> Steps:
    yield Flood(random.Random(1).randbytes(1 << 16))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_zeros(board: LyingBoard) -> Steps:
    yield Flood(bytes(1 << 16))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_without_a_zero(board: LyingBoard) -> Steps:
    yield Flood(b"\x01" * (1 << 16))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_single_bytes(board: LyingBoard) -> Steps:
    yield Flood(b"x\0" * (1 << 15))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_estimates(board: LyingBoard) -> Steps:
    yield Flood(b"".join(board.say(board.estimate(), TICKS) for _ in range(300)))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_samples(board: LyingBoard) -> Steps:
    frames = (board.say(board.samples(count=64), TICKS + 64 * i) for i in range(200))
    yield Flood(b"".join(frames))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_hashes(board: LyingBoard) -> Steps:
    yield Flood(b"".join(board.say(message(Hash, session=SESSION), CHECK_EVERY) for _ in range(2000)))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_starts(board: LyingBoard) -> Steps:
    yield Flood(b"".join(link.encode(board.hello(session=i), 0) for i in range(500)))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_schemas(board: LyingBoard) -> Steps:
    texts = (b"pvid 1\n" + b"\n".join(b"%d k%d a:u8" % (j, i) for j in range(90)) for i in range(100))
    yield Flood(b"".join(board.schema(text) for text in texts))


@_lie(0, 1)  # 1: some of it is not decoded
def _a_flood_of_configurations(board: LyingBoard) -> Steps:
    names = (Configure, Estimate, Status)
    yield Flood(b"".join(board.say(message(names[i % 3], session=i)) for i in range(900)))
