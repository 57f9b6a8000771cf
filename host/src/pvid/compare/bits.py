"""The C core against its twin, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.cases import case_of
from pvid.core.native import Native
from pvid.models.registry import DEFAULT, MODELS
from pvid.settings.kinds import Settings
from pvid.settings.record import Record
from pvid.twin import fnv

P_NAMES = MODELS[DEFAULT].p_names  # the library holds one mechanism

# The float strong form stores equal moments once: number of its sums, moments and entries of B.
_SHARED_MOMENTS = {58: (45, 11)}


def _layout(n_sums: int) -> tuple[int, int]:
    """Number of moments and of entries of B, or b, among the sums."""
    own = ((n * (n + 1) // 2, n) for n in range(1, 13) if n * (n + 1) // 2 + n + 2 == n_sums)
    return _SHARED_MOMENTS.get(n_sums) or next(own)


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
    core: Record,
    twin: Record,
    p_names: Sequence[str] = P_NAMES,
    moments: int = 0,
    layout: tuple[int, int] | None = None,
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


def compare_run(
    native: Native,
    config: Settings,
    phi: npt.ArrayLike,
    y: npt.ArrayLike,
    progress: Callable[[int], None] | None = None,
) -> Comparison:
    """Runs phi [rad], y [m], or counts, through the core and the twin of a configuration and compares every tick.

    Cost: about 0.5 ms a tick in the strong form, which solves at every tick, 0.01 ms in the weak form.
    """
    identifier = native.identifier(config)
    twin = case_of(config).twin(config).run(phi, y, progress=progress).lane()
    record = identifier.run(phi, y)
    hashes = fnv.running_hashes(twin)
    return Comparison(
        ticks=len(record.reason),
        core_hash=identifier.running_hash,
        twin_hash=int(hashes[-1]) if len(hashes) else fnv.START,
        difference=first_difference(record, twin),
    )
