"""FNV-1a, 32 bits: the running hash of pvid/fnv.h."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.record import Record

START = 0x811C9DC5
_PRIME = 0x01000193
_PIECE = 256  # ticks at a time, so that what is held stays in the processor's cache

Bytes = npt.NDArray[np.uint8]


def fold_bytes(running: int, data: bytes) -> int:
    """The hash continued over `data`."""
    for byte in data:
        running = ((running ^ byte) * _PRIME) & 0xFFFFFFFF
    return running


def _cumulative(bits: Bytes) -> Bytes:
    """Each byte XOR all before it; their number is a multiple of 8."""
    words = bits.view("<u8")
    for shift in (8, 16, 32):
        words = words ^ (words << shift)
    before = np.bitwise_xor.accumulate(words >> 56)[:-1]
    words[1:] ^= before * 0x0101010101010101
    return words.view(np.uint8)


def _multiplied(low: int, data: Bytes) -> Bytes:
    """Lowest byte of what is multiplied by the prime at every byte of `data`, `low` being that of the hash before.

    It depends on the lowest byte before alone, and bit k of it on bits 0 .. k: one cumulative sum modulo 2 a bit.
    """
    count = len(data)
    data = np.concatenate([data, np.zeros(-count % 8, np.uint8)])
    found = np.zeros_like(data)
    for k in range(8):
        carried = (found * np.uint8(_PRIME & 0xFF)) >> np.uint8(k)  # of the bits below k, into bit k of the next hash
        change: Bytes = data >> np.uint8(k)
        change[1:] ^= carried[:-1]
        change[0] ^= low >> k
        found |= (_cumulative(change) & np.uint8(1)) << np.uint8(k)
    return found[:count]


def _running(rows: Bytes, start: int) -> npt.NDArray[np.uint32]:
    """Hash after every row of bytes [ticks, width].

    With the lowest bytes known, h' = (h + multiplied - low) prime is linear modulo 2^32: a row is a scalar product.
    """
    ticks, width = rows.shape
    weights = np.array([pow(_PRIME, width - k, 2**32) for k in range(width)], np.uint32)
    out = np.empty(ticks, np.uint32)
    running, whole = start, pow(_PRIME, width, 2**32)
    for first in range(0, ticks, _PIECE):
        part = rows[first : first + _PIECE]
        data = part.ravel()
        multiplied = _multiplied(running & 0xFF, data)
        change = multiplied.astype(np.uint32)
        change -= multiplied ^ data
        for tick, linear in enumerate(np.einsum("ij,j->i", change.reshape(part.shape), weights).tolist(), first):
            running = (running * whole + linear) & 0xFFFFFFFF
            out[tick] = running
    return out


def sample_hashes(samples: npt.NDArray[np.float32] | npt.NDArray[np.int32]) -> npt.NDArray[np.uint32]:
    """Hash after every sample, of [ticks, 2] from a session's first tick on (Hash.sample_hash in pvid.link.frames)."""
    return _running(np.ascontiguousarray(samples, samples.dtype.newbyteorder("<")).view(np.uint8), START)


def of_words(words: npt.NDArray[np.uint32], start: int = START) -> npt.NDArray[np.uint32]:
    """Hash after every row of words [ticks, n]."""
    return _running(np.ascontiguousarray(words, "<u4").view(np.uint8), start)


def running_hashes(record: Record, start: int = START) -> npt.NDArray[np.uint32]:
    """Hash after every tick of a record (pvid/fnv.h, pvid/fnv_q31.h)."""
    return _running(record.hashed(), start)
