"""Corrupted frames against both decoders of the link: what is let through, and how soon they find their place again."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.case import Advance, Report, counts
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.link import frames as link

_BATCH = 500
_LENGTHS = 1025  # payloads of 0 to 1024 bytes
_HEAD = struct.Struct("<BHIH")
_ANY = 77  # a frame type that the link does not have: payloads of any length pass the C decoder, and none the other


@dataclass
class Tally:
    """Of corrupted frames, each followed by two good ones.

    wrong : frames that were let through and never sent;  lost_first, lost_second : good ones behind that were not
    """

    frames: int = 0
    wrong: int = 0
    lost_first: int = 0
    lost_second: int = 0


def _corrupted(frame: bytes, random: np.random.Generator) -> bytes:
    """With bits flipped, bytes dropped or inserted, the end cut off, or garbage around it."""
    data = bytearray(frame)
    kind = int(random.integers(0, 6))
    places = random.integers(0, len(data), int(random.integers(1, 4))).tolist()
    if kind == 0:
        for at in places:
            data[at] ^= 1 << int(random.integers(0, 8))
    elif kind == 1:
        for at in places:
            del data[min(at, len(data) - 1)]
    elif kind == 2:
        for at in places:
            data[at:at] = random.bytes(int(random.integers(1, 5)))
    elif kind == 3:
        del data[places[0] :]
    elif kind == 4:
        for at in places:
            data[at] = int(random.integers(0, 256))
    else:
        garbage = random.bytes(int(random.integers(1, 300)))
        data = bytearray(garbage + frame if places[0] % 2 else frame[: places[0]] + garbage)
    return bytes(data)


def corrupt(frames: int, native: Native, seed: int = 1, progress: Callable[[int], None] | None = None) -> Tally:
    """Feeds `frames` corrupted frames of every payload length to the C and the Python decoder.

    Raises
    ------
    PvidError
        When the two judge the same bytes differently.
    """
    random = np.random.default_rng(seed)
    tally = Tally()
    for first in range(0, frames, _BATCH):
        _batch(range(first, min(first + _BATCH, frames)), native, random, tally)
        if progress is not None:
            progress(first)
    return tally


def _batch(numbers: range, native: Native, random: np.random.Generator, tally: Tally) -> None:
    stream = bytearray()
    sent: dict[bytes, int] = {}
    for number in numbers:
        payload = random.bytes(number % _LENGTHS)
        frame = link.encode_raw(_ANY, 0, number, payload)
        damaged = _corrupted(frame, random)
        while damaged == frame:  # a byte put where it was, the final 0 cut off a frame that another one follows
            damaged = _corrupted(frame, random)
        stream += damaged
        if damaged.strip(b"\0") == frame[:-1] or frame in damaged:  # whole all the same
            sent[_key(_ANY, number, payload)] = 0
        for tick in (2 * number, 2 * number + 1):
            good = link.Hash(number & 0xFFFFFFFF, tick)
            stream += link.encode(good, 0, tick)
            sent[_key(good.TYPE, tick, good.payload)] = 1 + tick % 2
    accepted = decode_in_c(native, bytes(stream))
    decoder = link.Decoder()
    mine = [item for item in decoder.feed(bytes(stream)) if isinstance(item, link.Frame)]
    hashes = [frame for frame in accepted if frame[0] == link.Hash.TYPE]
    if [(frame.tick, frame.message.payload) for frame in mine] != [(tick, payload) for _, tick, payload in hashes]:
        raise PvidError("the decoders in C and in Python let different frames through")
    if decoder.counters.frames + decoder.counters.layout != len(accepted):
        raise PvidError("the decoders in C and in Python count different frames")
    keys = [_key(*frame) for frame in accepted]
    tally.frames += len(numbers)
    tally.wrong += sum(key not in sent for key in keys)
    for key in set(sent) - set(keys):
        tally.lost_first += sent[key] == 1
        tally.lost_second += sent[key] == 2


def _key(number: int, tick: int, payload: bytes) -> bytes:
    return bytes([number]) + tick.to_bytes(4, "little") + payload


def decode_in_c(native: Native, data: bytes) -> list[tuple[int, int, bytes]]:
    """(type, tick, payload) of the frames that the C decoder lets through."""
    ffi = native.headers.ffi
    out, counters = ffi.new("uint8_t[]", 2 * len(data) + 64), ffi.new("uint32_t[5]")
    n = native.library.pvid_native_link_decode(data, len(data), out, counters)
    found, at = [], 0
    raw = bytes(ffi.buffer(out, n))
    while at < n:
        number, _, tick, length = _HEAD.unpack_from(raw, at)
        at += _HEAD.size
        found.append((number, tick, raw[at : at + length]))
        at += length
    return found


def report(frames: int, advance: Advance) -> Report:
    """See bench.case."""
    tally = corrupt(frames, Native(), progress=lambda _: advance())
    numbers = (
        ("corrupted frames", tally.frames),
        ("accepted with wrong content", tally.wrong),
        ("first good frame behind lost", tally.lost_first),
        ("second good frame behind lost", tally.lost_second),
    )
    faults = ["a decoder accepts wrong content or loses the second good frame"] * bool(tally.wrong or tally.lost_second)
    return Report([counts("codec", numbers)], faults)
