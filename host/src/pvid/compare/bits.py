"""The C core against its twin, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pvid.settings.record import Record


def _layout(n_sums: int) -> tuple[int, int]:
    """Number of moments and of entries of B, or b, among the sums."""
    return next((n * (n + 1) // 2, n) for n in range(1, 13) if n * (n + 1) // 2 + n + 2 == n_sums)


def sum_name(index: int, n_sums: int, layout: tuple[int, int] | None = None) -> str:
    """Name of a sum by its place among `n_sums`: M[i], B[i], yy or weight.

    Parameters
    ----------
    layout : number of moments and of entries of B; None: by the number of sums
    """
    moments, n_theta = layout or _layout(n_sums)
    if index < moments:
        return f"M[{index}]"
    return f"B[{index - moments}]" if index < moments + n_theta else ("yy", "weight")[index - moments - n_theta]


@dataclass(frozen=True)
class Difference:
    """The first difference: tick, variable and both words (of floats their 32 bits)."""

    tick: int
    variable: str
    core_word: int
    twin_word: int
    core: str = "core"  # what is compared with the twin
    written: str = "08x"

    def __str__(self) -> str:
        words = f"{self.core} {self.core_word:{self.written}}, twin {self.twin_word:{self.written}}"
        return f"tick {self.tick}, {self.variable}: {words}"


@dataclass(frozen=True)
class Comparison:
    """Outcome of one core against the twin over `ticks` ticks."""

    ticks: int
    core_hash: int
    twin_hash: int
    difference: Difference | None

    @property
    def equal(self) -> bool:
        """Every p, sum, status and published p equal in bits, and the running hashes with them."""
        return self.difference is None and self.core_hash == self.twin_hash


def first_difference(
    core: Record, twin: Record, p_names: Sequence[str], moments: int = 0, layout: tuple[int, int] | None = None
) -> Difference | None:
    """The first difference between a replay of the core and a lane of its twin: p, sums, status, published p.

    Parameters
    ----------
    p_names : of the parameters
    moments : entries of M among the sums; 0: by the number of sums
    layout : the same with the number of entries of B
    """
    layout = layout or (moments, core.sums.shape[1] - moments - 2) if moments else layout
    names: dict[str, Callable[[int], str]] = {
        "p": p_names.__getitem__,
        "sums": lambda place: sum_name(place, core.sums.shape[1], layout),
        "exponent": lambda _: "exponent of the sums",
        "status": lambda _: "status",
        "published": lambda place: f"published {p_names[place]}",
    }
    found, twins = [], twin.words()
    for order, (part, own) in enumerate(core.words().items()):
        other = twins.get(part, own)
        ticks, places = np.nonzero(own != other)
        if len(ticks):
            at = int(ticks[0]), int(places[0])
            found.append((at[0], order, names[part](at[1]), int(own[at]), int(other[at])))
    if not found:
        return None
    tick, _, variable, core_word, twin_word = min(found)
    return Difference(tick, variable, core_word, twin_word, written="d" if core.is_fixed else "08x")
