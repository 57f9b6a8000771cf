"""The frame codec: Python against C on the same bytes, and both against damage."""

import random
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.fuzz import fuzz_link
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.link import frames as link

NATIVE = Native()
C, FFI = NATIVE.library, NATIVE.headers.ffi
HEAD = struct.Struct("<BHIH")

payloads = st.integers(0, link.MAX_PAYLOAD).flatmap(lambda n: st.binary(min_size=n, max_size=n))
repetitive = st.builds(
    lambda piece, n: (piece * 2048)[:n], st.binary(min_size=1, max_size=300), st.integers(0, link.MAX_PAYLOAD)
)
frames = st.tuples(
    st.integers(0, 255), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF), st.one_of(payloads, repetitive)
)

FUZZ_RUNS = 100_000
CORRUPTED_FRAMES = 25_000


def c_encode(number: int, sequence: int, tick: int, payload: bytes) -> bytes:
    out = FFI.new("uint8_t[]", 2 * link.MAX_PAYLOAD)
    n = C.pvid_native_link_encode(number, sequence, tick, payload, len(payload), out, len(out))
    return bytes(FFI.buffer(out, n))


def c_decode(data: bytes) -> tuple[list[tuple[int, int, int, bytes]], list[int]]:
    """Frames (type, sequence, tick, payload) and counters (frames, missing, malformed, crc, foreign)."""
    out, counters = FFI.new("uint8_t[]", 2 * len(data) + 64), FFI.new("uint32_t[5]")
    n = C.pvid_native_link_decode(data, len(data), out, counters)
    raw = bytes(FFI.buffer(out, n))
    found, at = [], 0
    while at < n:
        number, sequence, tick, length = HEAD.unpack_from(raw, at)
        at += HEAD.size
        found.append((number, sequence, tick, raw[at : at + length]))
        at += length
    return found, list(counters)


def assert_same_as_c(data: bytes) -> tuple[link.Decoder, list[link.Frame]]:
    decoder = link.Decoder()
    got = [item for item in decoder.feed(data) if isinstance(item, link.Frame)]
    accepted, counters = c_decode(data)
    kept = [frame for frame in accepted if well_laid_out(frame[0], frame[3])]
    assert [(f.message.TYPE, f.sequence, f.tick) for f in got] == [frame[:3] for frame in kept]
    mine = decoder.counters
    assert [mine.frames + mine.layout, mine.missing, mine.malformed, mine.crc, mine.foreign] == counters
    return decoder, got


def well_laid_out(number: int, payload: bytes) -> bool:
    try:
        link.LAYOUTS[number].unpack(payload)
    except (KeyError, PvidError):
        return False
    return True


@settings(max_examples=300)
@given(frames)
def test_c_and_python_encode_the_same_bytes(frame: tuple[int, int, int, bytes]) -> None:
    encoded = link.encode_raw(*frame)
    assert c_encode(*frame) == encoded
    assert encoded.index(0) == len(encoded) - 1
    assert c_decode(encoded) == ([frame], [1, 0, 0, 0, 0])


@pytest.mark.parametrize("fill", [b"\0", b"\1", b"\xff", b"\1" * 253 + b"\0", b"\1" * 254 + b"\0"])
def test_every_length_encodes_alike_and_decodes(fill: bytes) -> None:
    for n in range(link.MAX_PAYLOAD + 1):
        frame = (4, n, 7, (fill * 2048)[:n])
        encoded = link.encode_raw(*frame)
        assert c_encode(*frame) == encoded
        assert c_decode(encoded)[0] == [frame]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A few frames in garbage, with bytes flipped, dropped, inserted and the end cut off."""
    parts = [draw(st.binary(max_size=20))]
    for sequence in range(draw(st.integers(1, 4))):
        samples = draw(st.integers(0, 40))
        number = draw(st.sampled_from([1, 4, 8, 9, 77]))
        payload = draw(st.binary(min_size=8 * samples, max_size=8 * samples))
        parts += [link.encode_raw(number, sequence, samples, payload), draw(st.sampled_from([b"", b"\0", b"\7\7"]))]
    data = bytearray(b"".join(parts))
    for _ in range(draw(st.integers(0, 5))):
        at = draw(st.integers(0, len(data) - 1)) if data else 0
        kind = draw(st.sampled_from(["flip", "drop", "insert", "cut"]))
        if kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "drop":
            del data[at : at + draw(st.integers(1, 3))]
        elif kind == "insert":
            data[at:at] = draw(st.binary(max_size=4))
        else:
            del data[at + 1 :]
    return bytes(data)


@settings(max_examples=500)
@given(damaged(), st.lists(st.integers(1, 50), max_size=20))
def test_damage_is_judged_alike_however_it_is_cut(data: bytes, cuts: list[int]) -> None:
    decoder, _ = assert_same_as_c(data)
    pieces, at = link.Decoder(), 0
    for cut in [*cuts, len(data)]:
        pieces.feed(data[at : at + cut])
        at += cut
    assert pieces.counters == decoder.counters


@settings(max_examples=200)
@given(st.binary(max_size=3000))
def test_after_any_garbage_the_next_frame_comes_through(garbage: bytes) -> None:
    decoder = link.Decoder()
    decoder.feed(garbage + b"\0")
    message = link.Hash(session=1, hash=0xDEADBEEF)
    assert [f for f in decoder.feed(link.encode(message, 5, 99)) if isinstance(f, link.Frame)] == [
        link.Frame(5, 99, message)
    ]


def corrupted(frame: bytes, chance: random.Random) -> bytes:
    """With bits flipped, bytes dropped, put in or replaced, the end cut off, or garbage around it."""
    data = bytearray(frame)
    places = [chance.randrange(len(data)) for _ in range(chance.randint(1, 3))]
    match chance.randrange(6):
        case 0:
            for at in places:
                data[at] ^= 1 << chance.randrange(8)
        case 1:
            for at in places:
                del data[min(at, len(data) - 1)]
        case 2:
            for at in places:
                data[at:at] = chance.randbytes(chance.randint(1, 4))
        case 3:
            del data[places[0] :]
        case 4:
            for at in places:
                data[at] = chance.randrange(256)
        case _:
            garbage = chance.randbytes(chance.randint(1, 299))
            data = bytearray(garbage + frame if places[0] % 2 else frame[: places[0]] + garbage)
    return bytes(data)


def test_of_many_corrupted_frames_none_is_accepted_wrong() -> None:
    """Of every length, both decoders alike; CRC-32 lets one in 4e9 through, so none is to be expected.

    The first good frame behind damage may be lost, when the damage took the 0 between them; the second never is.
    """
    chance, lost_first = random.Random(1), 0
    for first in range(0, CORRUPTED_FRAMES, 500):
        stream, whole = bytearray(), set()
        for tick in range(first, first + 500):
            payload = chance.randbytes(tick % 1025)
            frame = link.encode_raw(77, 0, tick, payload)  # a type that there is not: C lets any payload through
            damaged = corrupted(frame, chance)
            if damaged.strip(b"\0") == frame[:-1] or frame in damaged:
                whole.add((77, 0, tick, payload))
            stream += damaged + b"".join(link.encode(link.Hash(tick, hash=k), k, tick) for k in (1, 2))
        good = {
            (link.Hash.TYPE, k, tick, link.Hash(tick, hash=k).payload)
            for tick in range(first, first + 500)
            for k in (1, 2)
        }
        assert_same_as_c(bytes(stream))
        accepted = set(c_decode(bytes(stream))[0])
        assert accepted <= good | whole
        assert {one[1] for one in good - accepted} <= {1}
        lost_first += len(good - accepted)
    assert 0 < lost_first < CORRUPTED_FRAMES / 2


def test_messages_survive_the_way() -> None:
    values = np.array([[1.5, -2.0], [np.float32(1e-45), 3e38]], np.float32)
    sample = link.Sample.of_values(values[:, 0], values[:, 1])
    p = (1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, -1.0)
    estimate = link.Estimate(9, 4, p, tuple(map(float, range(36))), 0.5, 0.25, 8.0, 2)
    unit = (0.5, 1.0, 1.0, 2.0**-40, 0.0, 0.0, 0.0, 0.0)
    hello = link.Hello(1, 1, 4, 256, 5, 0, 1000.0, 2.0**-11, 2.0**-17, unit, "mps2-an386")
    extremes = (-(2**31), 2**31 - 1, -1, 0, 1, 2, 3, 4)
    fixed = link.ConfigureQ31(7, 5, 1, 2, 500, 0, 1, extremes, extremes, extremes, extremes, 3, 2**32 - 1, 2**30, -5, 6)
    counts = link.RawCount.of_values(extremes[:3], extremes[3:6])
    motor = link.Raw.of_values(*np.arange(12.0).reshape(3, 4))
    sent = [sample, estimate, hello, fixed, counts, motor]
    data = b"".join(link.encode(m, i, i) for i, m in enumerate(sent))
    got = [item for item in link.Decoder().feed(data) if isinstance(item, link.Frame)]
    assert [frame.message for frame in got] == sent
    assert counts.values.tolist() == [[-(2**31), 0], [2**31 - 1, 1], [-1, 2]]
    assert isinstance(got[0].message, link.Sample)
    assert np.array_equal(got[0].message.of_each(2), values)
    assert motor.samples == 3 and motor.count == 4 and motor.values[1].tolist() == [1.0, 5.0, 9.0]


def test_the_schema_describes_itself() -> None:
    assert link.parse_schema(link.SCHEMA_TEXT) == link.LAYOUTS
    assert len(link.SCHEMA_TEXT) <= link.MAX_PAYLOAD
    for broken in ("", "pvid x", link.SCHEMA_TEXT + "\n9 q r:u7", link.SCHEMA_TEXT + "\nx"):
        with pytest.raises(PvidError):
            link.parse_schema(broken)


def test_c_header_equals_the_python_definition() -> None:
    written = (ROOT / "firmware" / "link" / "schema.h").read_text(encoding="utf-8")
    assert written == link.c_header(), "./tools/pvid schema > firmware/link/schema.h"


def test_loss_report_names_the_lost_samples() -> None:
    hash_frame = link.encode(link.Hash(1, 2), 0)
    later = link.encode(link.Hash(1, 2), 3)
    broken = bytearray(later)
    broken[5] ^= 0x10
    items = link.Decoder().feed(hash_frame + bytes(broken) + later)
    assert items[1] == link.Loss("crc", bytes=len(later) - 1)
    assert items[2] == link.Loss("sequence", frames=2)
    assert isinstance(items[3], link.Frame)


def test_the_c_side_withstands_fuzzing(tmp_path: Path) -> None:
    assert fuzz_link(tmp_path, FUZZ_RUNS) == FUZZ_RUNS


def test_decoder_accepts_the_schema_of_another_version() -> None:
    today = link.Hash.layout().text
    text = link.SCHEMA_TEXT.replace(today, "8 hash session:u32 hash:u64 phase:u8")
    other = zlib.crc32(text.encode())
    sent = [
        link.encode_raw(link.Schema.TYPE, 0, 0, text.encode(), other),
        link.encode_raw(link.Hash.TYPE, 1, 9, struct.pack("<IQB", 7, 2**40, 3), other),
        link.encode(link.Credit(1, 2, 3, 4), 4, 9, other),
    ]
    learning = link.Decoder(learns=True)
    frames = [item for item in learning.feed(b"".join(sent)) if isinstance(item, link.Frame)]
    assert [frame.message for frame in frames[1:]] == [
        link.Described("hash", {"session": 7, "hash": 2**40, "phase": 3}),
        link.Credit(1, 2, 3, 4),  # laid out as today
    ]
    assert learning.counters == link.Counters(frames=3, missing=2)
    assert link.Decoder().feed(b"".join(sent)) == [link.Loss("foreign", bytes=len(one) - 1) for one in sent]


# The schema when a tick had two samples and a mechanism at most six parameters.
TWO_SAMPLES = """\
pvid 1
1 hello form:u8 core:u8 n_p:u8 window:u16 settings:u32 session:u32 sample_rate:f32 phi_lsb:f32 y_lsb:f32 \
p_unit:f32[6] board:char[16] tick_high:u16
2 schema text:char[]
3 configure session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 law:u8 \
start:f32[6] start_sd:f32[6] lower:f32[6] upper:f32[6] row_sd:f32 forgetting_s:f32 feedback_hz:f32 first_tick:u64
4 sample phi_y:f32[]
5 raw session:u32 tick_high:u16 phi_y:f32[]
6 estimate session:u32 updates:u32 p:f32[6] covariance:f32[21] kappa:f32 residual_sd:f32 weight:f32 reason:u8 \
tick_high:u16
7 status session:u32 code:u8 core:u8 updates:u32 rejected:u32 repeated:u32 skipped:u32 missing:u32 malformed:u32 \
bad_crc:u32 foreign:u32 tick_high:u16
8 hash session:u32 hash:u32 tick_high:u16 sample_hash:u32
9 credit session:u32 room:u32 hash:u32 reason:u8 tick_high:u16 sample_hash:u32
10 configure_q31 session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 \
start:i32[6] start_sd:i32[6] lower:i32[6] upper:i32[6] row_sd:i32 forgetting_groups:u32 gain:i32 phi_offset:i32 \
y_offset:i32 first_tick:u64
11 count phi_y:i32[]
12 raw_count session:u32 tick_high:u16 phi_y:i32[]
13 estimate_q31 session:u32 updates:u32 p:i32[6] se:i32[6] correlation:i32[21] kappa:i32 residual_sd:i32 weight:u32 \
reason:u8 tick_high:u16"""


def of_schema(text: str, *frames: tuple[int, bytes]) -> list[link.Message]:
    """What a decoder that learns makes of frames of that schema."""
    number = zlib.crc32(text.encode())
    sent = [link.encode_raw(link.Schema.TYPE, 0, 0, text.encode(), number)]
    sent += [link.encode_raw(kind, i, 9, payload, number) for i, (kind, payload) in enumerate(frames, 1)]
    read = [one for one in link.Decoder(learns=True).feed(b"".join(sent)) if isinstance(one, link.Frame)]
    return [one.message for one in read[1:]]


def test_frames_of_the_schema_before_ticks_had_48_bits_are_those_of_today() -> None:
    text = re.sub(r" (tick_high|sample_hash|first_tick):u\d+", "", TWO_SAMPLES)
    text = re.sub(r"(raw|raw_count) session:u32", r"\1", text)
    assert zlib.crc32(text.encode()) == 0xA1646BC5
    raw = link.Raw.of_values([1.0, 2.0], [3.0, 4.0])
    found = of_schema(text, (link.Raw.TYPE, raw.data), (link.Hash.TYPE, struct.pack("<II", 7, 8)))
    assert found == [raw, link.Hash(7, hash=8)]


def test_frames_of_two_samples_and_six_parameters_are_those_of_today() -> None:
    assert zlib.crc32(TWO_SAMPLES.encode()) == 0xE1F24363
    p = tuple(float(i) for i in range(6))
    triangle = [10.0 * i + j for i in range(6) for j in range(i, 6)]
    hello = struct.pack("<BBBHIIf2f6f16sH", 1, 0, 4, 256, 5, 6, 1e3, 0.25, 0.5, *p, b"old", 3)
    configure = struct.pack("<IIBBHHHB24ffffQ", 6, 5, 1, 1, 50, 60, 1, 0, *p, *p, *p, *p, 0.5, 2.0, 3.0, 1 << 40)
    estimate = struct.pack("<II6f21f3fBH", 6, 4, *p, *triangle, 0.5, 0.25, 8.0, 2, 3)
    fixed = struct.pack("<II6i6i21iiiIBH", 6, 4, *range(6), *range(6), *range(21), 1, 2, 3, 2, 3)
    counted = struct.pack("<IH4i", 6, 0, 1, 2, 3, 4)
    found = of_schema(TWO_SAMPLES, (1, hello), (3, configure), (6, estimate), (13, fixed), (12, counted), (11, b""))
    eight = (*p, 0.0, 0.0)
    assert found[0] == link.Hello(1, 0, 4, 256, 5, 6, 1e3, 0.25, 0.5, eight, "old", tick_high=3, samples=2)
    assert found[1] == link.Configure(
        6, 5, 1, 1, 50, 60, 1, 0, eight, eight, eight, eight, 0.5, 2.0, 3.0, first_tick=1 << 40
    )
    assert isinstance(found[2], link.Estimate) and found[2].p == eight
    covariance = found[2].in_si(np.ones(8), 0.0)[1]
    assert covariance[2, 5] == covariance[5, 2] == 25.0 and covariance[5, 5] == 55.0 and not covariance[6:].any()
    assert isinstance(found[3], link.EstimateQ31) and found[3].p == (*range(6), 0, 0)
    assert isinstance(found[4], link.RawCount) and found[4].values.tolist() == [[1, 2], [3, 4]]
    assert found[5] == link.Count(b"")


@pytest.mark.parametrize("samples", [0, 9, 255])
def test_a_frame_of_no_samples_or_too_many_a_tick_is_damage(samples: int) -> None:
    payload = struct.pack("<IHB", 1, 0, samples) + bytes(72)
    items = link.Decoder().feed(link.encode_raw(link.Raw.TYPE, 0, 0, payload))
    assert [item.why for item in items if isinstance(item, link.Loss)] == ["layout"]


def test_a_tick_has_48_bits_where_a_board_sends_it() -> None:
    tick = (7 << 32) + 5
    (frame,) = link.Decoder().feed(link.encode(link.Hash(1, hash=2), 0, tick))
    assert frame == link.Frame(0, tick, link.Hash(1, tick_high=7, hash=2))
    (frame,) = link.Decoder().feed(link.encode(link.Schema(b"x"), 0, tick))
    assert frame == link.Frame(0, 5, link.Schema(b"x"))


def test_schema_is_accepted_only_if_its_hash_matches() -> None:
    forged = link.encode_raw(link.Schema.TYPE, 0, 0, link.SCHEMA_TEXT.encode() + b" ", 12345)
    garbage = b"pvid 1\n\xff\xfe"
    senseless = link.encode_raw(link.Schema.TYPE, 0, 0, garbage, zlib.crc32(garbage))
    decoder = link.Decoder(learns=True)
    decoder.feed(forged + senseless)
    assert decoder.counters == link.Counters(foreign=2)
