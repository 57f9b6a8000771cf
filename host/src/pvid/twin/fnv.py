"""FNV-1a, 32 bits: the running hash of pvid/fnv.h."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

START = 0x811C9DC5
_PRIME = 0x01000193


def fold_bytes(running: int, data: bytes) -> int:
    """The hash continued over `data`."""
    for byte in data:
        running = ((running ^ byte) * _PRIME) & 0xFFFFFFFF
    return running


def running_hashes(
    p: npt.NDArray[np.float32],
    sums: npt.NDArray[np.float32],
    reason: npt.NDArray[np.uint8],
    start: int = START,
) -> npt.NDArray[np.uint32]:
    """Hash after every tick of one lane, over p [ticks, n_p], sums [ticks, n] and reason [ticks].

    The bytes of a tick are p, the sums and the reason as a 32-bit word, all little-endian.
    """
    ticks = len(reason)
    words = np.concatenate(
        [
            np.ascontiguousarray(p).view(np.uint32),
            np.ascontiguousarray(sums).view(np.uint32),
            reason.astype(np.uint32)[:, None],
        ],
        axis=1,
    )
    width = 4 * words.shape[1]
    data = words.astype("<u4").tobytes()
    out = np.empty(ticks, np.uint32)
    running = start
    for tick in range(ticks):
        running = fold_bytes(running, data[tick * width : (tick + 1) * width])
        out[tick] = running
    return out


def running_hashes_q31(
    p: npt.NDArray[np.int32],
    sums: npt.NDArray[np.int64],
    exponent: npt.NDArray[np.uint8],
    reason: npt.NDArray[np.uint8],
    start: int = START,
) -> npt.NDArray[np.uint32]:
    """Hash after every tick of one lane of the fixed-point core (pvid/fnv_q31.h); shapes as in `running_hashes`."""
    pieces = [
        np.ascontiguousarray(p, "<i4").view(np.uint8),
        np.ascontiguousarray(sums, "<i8").view(np.uint8),
        exponent.astype("<u4")[:, None].view(np.uint8),
        reason.astype("<u4")[:, None].view(np.uint8),
    ]
    data = np.concatenate(pieces, axis=1)
    out = np.empty(len(data), np.uint32)
    running = start
    for tick, row in enumerate(data):
        running = fold_bytes(running, row.tobytes())
        out[tick] = running
    return out
