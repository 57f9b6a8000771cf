"""The fixed-point core against its twin, tick by tick."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pvid.core.native import Identifier, Native
from pvid.run.compare import P_NAMES, Comparison, Difference
from pvid.settings.q31 import WeakConfigQ31
from pvid.settings.record import Record
from pvid.setup.q31 import ConfigQ31
from pvid.twin import fnv
from pvid.twin.strong_q31 import StrongTwinQ31
from pvid.twin.weak_q31 import TwinRecordQ31, WeakTwinQ31


class DifferenceQ31(Difference):
    """The first integer that differs: tick, variable and both values."""

    def __str__(self) -> str:
        return f"tick {self.tick}, {self.variable}: core {self.core_word}, twin {self.twin_word}"


def sum_name(index: int, n_sums: int) -> str:
    """Name of a sum by its place: M[i], b[i], rr or weight."""
    n_theta = next(n for n in range(1, 13) if n * (n + 1) // 2 + n + 2 == n_sums)
    moments = n_theta * (n_theta + 1) // 2
    if index < moments:
        return f"M[{index}]"
    return f"b[{index - moments}]" if index < moments + n_theta else ("rr", "weight")[index - moments - n_theta]


def first_difference(record: Record, twin: TwinRecordQ31, lane: int = 0) -> DifferenceQ31 | None:
    """The first difference between a replay of the core and a lane of the twin, p before sums before status."""
    n_sums = twin.sums.shape[1]
    names: list[Callable[[int], str]] = [
        P_NAMES.__getitem__,
        lambda i: sum_name(i, n_sums),
        lambda _: "exponent of the sums",
        lambda _: "status",
    ]
    pairs: list[tuple[npt.NDArray[np.integer], npt.NDArray[np.integer]]] = [
        (record.p, twin.p[:, :, lane]),
        (record.sums, twin.sums[:, :, lane]),
        (record.exponent[:, None], twin.exponent[:, lane, None]),
        (record.reason[:, None], twin.reason[:, lane, None]),
    ]
    if twin.published is not None and len(record.published):
        names.append(lambda i: f"published {P_NAMES[i]}")
        pairs.append((record.published, twin.published[:, :, lane]))
    found = []
    for order, ((core, other), name) in enumerate(zip(pairs, names, strict=True)):
        ticks, places = np.nonzero(core != other)
        if len(ticks):
            at = (int(ticks[0]), int(places[0]))
            found.append((at[0], order, name(at[1]), int(core[at]), int(other[at])))
    if not found:
        return None
    tick, _, variable, core_value, twin_value = min(found)
    return DifferenceQ31(tick, variable, core_value, twin_value)


def twin_hashes(twin: TwinRecordQ31, lane: int = 0) -> npt.NDArray[np.uint32]:
    """Running hash of a lane of the twin after every tick."""
    return fnv.running_hashes_q31(
        twin.p[:, :, lane], twin.sums[:, :, lane], twin.exponent[:, lane], twin.reason[:, lane]
    )


def identifier_q31(native: Native, config: ConfigQ31) -> Identifier:
    """The core's identifier of a configuration."""
    if isinstance(config, WeakConfigQ31):
        return native.identifier(config)
    return native.identifier(config)


def twin_q31(config: ConfigQ31) -> WeakTwinQ31 | StrongTwinQ31:
    """The twin of a configuration."""
    return WeakTwinQ31(config) if isinstance(config, WeakConfigQ31) else StrongTwinQ31(config)


def compare_run_q31(
    native: Native,
    config: ConfigQ31,
    phi: npt.ArrayLike,
    y: npt.ArrayLike,
    progress: Callable[[int], None] | None = None,
) -> Comparison:
    """Runs counts phi, y through the core and the twin and compares every tick."""
    core = native.identifier(config)
    record = core.run(phi, y)
    twin = twin_q31(config).run(np.asarray(phi, np.int64), np.asarray(y, np.int64), progress=progress)
    hashes = twin_hashes(twin)
    twin_hash = int(hashes[-1]) if len(hashes) else fnv.START
    return Comparison(len(record.reason), core.running_hash, twin_hash, first_difference(record, twin))
