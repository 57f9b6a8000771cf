"""Record of a run, by the C core or by a lane of its twin."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Doubt, Standing

Array = npt.NDArray[Any]
_STANDING = ("age", "state", "causes")
Bytes = npt.NDArray[np.uint8]

# Types of p and of the sums in the bytes that the running hash covers, by numpy's kind of number.
HASHED_TYPES = {"f": ("<f4", "<f4"), "i": ("<i4", "<i8")}


def _none(dtype: npt.DTypeLike) -> Any:
    return field(default_factory=lambda: np.empty(0, dtype))


def _integers(values: Array) -> Array:
    """Floats as their 32 bits, integers as they are."""
    return np.ascontiguousarray(values).view(np.uint32) if values.dtype.kind == "f" else values


@dataclass
class Record:
    """One entry per tick along the first axis; float32, or integers in fixed point.

    p
        The estimator's parameters [ticks, n_p].
    sums
        M, B, yy and weight [ticks, n] (fixed point: int64, M, b, rr times 4^-exponent, and weight).
    reason
        Outcome of each tick, uint8 [ticks].
    exponent
        Of the sums [ticks] in fixed point; else empty.
    published, published_se
        The weak form's published p and its standard errors [ticks, n_p]; else empty.
    standing
        Of the published estimate (pvid/standing.h): age + 2^16 state + 2^24 causes, uint32 [ticks]; else empty.
    hash
        Running hash after each tick, uint32 [ticks]; empty if it was not requested.
    estimate
        An assessed estimate every `estimate_every` ticks, structured. In the weak form in fixed point it is the
        published one.
    """

    p: Array
    sums: Array
    reason: npt.NDArray[np.uint8]
    exponent: npt.NDArray[np.uint8] = _none(np.uint8)
    published: Array = _none(np.float32)
    published_se: Array = _none(np.float32)
    standing: npt.NDArray[np.uint32] = _none(np.uint32)
    hash: npt.NDArray[np.uint32] = _none(np.uint32)
    estimate: npt.NDArray[np.void] = _none(np.void)

    @property
    def is_fixed(self) -> bool:
        """Whether the numbers are integers."""
        return self.p.dtype.kind != "f"

    def words(self) -> dict[str, Array]:
        """The compared quantities as integers [ticks, n], floats as their 32 bits, in the order of the comparison."""
        parts = {"p": self.p, "sums": self.sums, "exponent": self.exponent[:, None], "status": self.reason[:, None]}
        if len(self.published):
            parts["published"] = self.published
        return {name: _integers(values) for name, values in parts.items()}

    def hashed(self) -> Bytes:
        """The bytes of every tick that the running hash covers, uint8 [ticks, n]: p, the sums and the reason as a
        32-bit word, in fixed point the exponent before it; all little-endian."""
        narrow, wide = HASHED_TYPES[self.p.dtype.kind]
        pieces = [self.p.astype(narrow), self.sums.astype(wide), self.reason.astype("<u4")[:, None]]
        if self.is_fixed:
            pieces.insert(2, self.exponent.astype("<u4")[:, None])
        return np.concatenate([np.ascontiguousarray(piece).view(np.uint8) for piece in pieces], axis=1)


def standing_word(one: Any) -> int:
    """Of a standing (a printed struct, or a record of numpy) that of `standing`."""
    age, state, causes = (int(one[name] if isinstance(one, np.void) else getattr(one, name)) for name in _STANDING)
    return age + (state << 16) + (causes << 24)


def standing_text(word: int) -> str:
    """An entry of `standing` in words: "doubted (grew, misfit), 3 windows old"; empty for one that does not exist."""
    if word >> 16 & 0xFF not in list(Standing):
        return ""
    state, causes, age = Standing(word >> 16 & 0xFF), word >> 24, word & 0xFFFF
    names = [one.text for one in Doubt if one & causes]
    because = f" ({', '.join(names)})" if names else ""
    old = f", {age} window{'s' if age > 1 else ''} old" if age and state != Standing.NONE else ""
    return state.text + because + old
