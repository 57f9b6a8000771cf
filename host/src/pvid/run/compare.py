"""The C core against its twin, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.core.native import Identifier, Native
from pvid.models.registry import DEFAULT, MODELS
from pvid.settings.f32 import StrongConfig, WeakConfig
from pvid.settings.record import Record
from pvid.twin import fnv
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

P_NAMES = MODELS[DEFAULT].p_names  # the library holds one mechanism

# Moments and entries of B by the number of sums: strong form, weak form with and without the encoder's zero, and with
# friction.
_LAYOUTS = {
    n_sums: (moments, n_theta) for n_sums, moments, n_theta in ((58, 45, 11), (46, 36, 8), (22, 15, 5), (67, 55, 10))
}


def sum_name(index: int, n_sums: int) -> str:
    """Name of a sum by its place among `n_sums`: M[i], B[i], yy or weight."""
    moments, n_theta = _LAYOUTS[n_sums]
    if index < moments:
        return f"M[{index}]"
    if index < moments + n_theta:
        return f"B[{index - moments}]"
    return ("yy", "weight")[index - moments - n_theta]


@dataclass(frozen=True)
class Difference:
    """The first bit that differs: tick, variable and both 32-bit words."""

    tick: int
    variable: str
    core_word: int
    twin_word: int
    core: str = "core"  # what is compared with the twin

    def __str__(self) -> str:
        return f"tick {self.tick}, {self.variable}: {self.core} {self.core_word:08x}, twin {self.twin_word:08x}"


@dataclass(frozen=True)
class Comparison:
    """Outcome of one core against the twin over `ticks` ticks."""

    ticks: int
    core_hash: int
    twin_hash: int
    difference: Difference | None

    @property
    def equal(self) -> bool:
        """Every p, M, B, yy, weight and status equal in bits, and the running hashes with them."""
        return self.difference is None and self.core_hash == self.twin_hash


def _words(values: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]:
    return np.ascontiguousarray(values).view(np.uint32)


def first_difference(
    record: Record,
    p: npt.NDArray[np.float32],
    sums: npt.NDArray[np.float32],
    reason: npt.NDArray[np.uint8],
    published: npt.NDArray[np.float32] | None = None,
) -> Difference | None:
    """The first difference between a replay of the core and one lane of the twin: p, sums, status, then what is
    published."""
    n_sums = sums.shape[1]
    names: list[Callable[[int], str]] = [P_NAMES.__getitem__, lambda i: sum_name(i, n_sums), lambda _: "status"]
    cores = [_words(record.p), _words(record.sums), record.reason[:, None].astype(np.uint32)]
    twins = [_words(p), _words(sums), reason[:, None].astype(np.uint32)]
    if published is not None:
        names.append(lambda i: f"published {P_NAMES[i]}")
        cores.append(_words(record.published))
        twins.append(_words(published))
    found: list[tuple[int, int, str, int, int]] = []
    for order, (core, twin, name) in enumerate(zip(cores, twins, names, strict=True)):
        ticks, places = np.nonzero(core != twin)
        if len(ticks):
            tick, place = int(ticks[0]), int(places[0])
            found.append((tick, order, name(place), int(core[tick, place]), int(twin[tick, place])))
    if not found:
        return None
    tick, _, variable, core_word, twin_word = min(found)
    return Difference(tick, variable, core_word, twin_word)


def compare_run(
    native: Native,
    config: StrongConfig | WeakConfig,
    phi: npt.ArrayLike,
    y: npt.ArrayLike,
    progress: Callable[[int], None] | None = None,
) -> Comparison:
    """Runs phi [rad], y [m] through the core and the twin and compares every tick.

    Cost: about 0.5 ms a tick in the strong form, which solves at every tick, 0.01 ms in the weak form.
    """
    identifier: Identifier
    if isinstance(config, WeakConfig):
        identifier = native.identifier(config)
        twin = WeakTwin(config).run(phi, y, progress=progress)
    else:
        identifier = native.identifier(config)
        twin = StrongTwin(config).run(phi, y, progress=progress)
    record = identifier.run(phi, y)
    p, sums, reason = twin.p[:, :, 0], twin.sums[:, :, 0], twin.reason[:, 0]
    hashes = fnv.running_hashes(p, sums, reason)
    return Comparison(
        ticks=len(record.reason),
        core_hash=identifier.running_hash,
        twin_hash=int(hashes[-1]) if len(hashes) else fnv.START,
        difference=first_difference(
            record, p, sums, reason, twin.published[:, :, 0] if isinstance(config, WeakConfig) else None
        ),
    )
