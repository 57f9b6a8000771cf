"""Identifiers of any form and core against their numpy twin, some estimators at a time, in any number of builds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.cases import case_of
from pvid.compare.bits import first_difference
from pvid.core.native import Identifier, Native
from pvid.settings.record import Record
from pvid.twin import fnv


@dataclass
class Lane:
    """An estimator that has been compared: the last build's record, its identifier after the run, and the twin."""

    record: Record
    core: Identifier
    twin: Any

    @property
    def counters(self) -> dict[str, int]:
        """Of the core, and of the twin."""
        return self.core.counters


def beginning(record: Record, ticks: int) -> Record:
    """The first ticks of a run."""
    return Record(record.p[:ticks], record.sums[:ticks], record.reason[:ticks], record.exponent[:ticks])


def assert_lanes_equal(
    natives: Iterable[Native],
    config: Any,
    phi: npt.NDArray[Any],
    y: npt.NDArray[Any],
    lanes: Sequence[Any] | None = None,
    hashed_ticks: int = 0,
) -> list[Lane]:
    """Asserts that every build has the twin's bits after every tick, its counters and its estimates, in every lane: one
    for each of `lanes`, which are settings of estimators, by default the configuration's own.

    The running hash is compared for the first `hashed_ticks`: it is a function of these bits, and slow in Python.
    """
    lanes = [config.estimator] if lanes is None else lanes
    twin = case_of(config).twin(config, lanes)
    expected = twin.run(phi, y)
    assessed = twin.estimator.assess()
    found = []
    for lane, estimator in enumerate(lanes):
        own = expected.lane(lane)
        hashes = fnv.running_hashes(beginning(own, hashed_ticks)) if hashed_ticks else None
        counters = {name: int(of[lane]) for name, of in twin.estimator.counters.items()}
        for native in natives:
            core = native.identifier(replace(config, estimator=estimator))
            record = core.run(phi, y)
            assert first_difference(record, own) is None, native.build
            assert hashes is None or np.array_equal(record.hash[:hashed_ticks], hashes), native.build
            assert core.running_hash == record.hash[-1]
            assert core.counters == counters, (core.counters, counters)
            assert core.assess().tobytes() == assessed[lane].tobytes()
            if core.publishes:
                assert core.estimate.tobytes() == twin.trust.estimate[lane].tobytes()
                assert core.is_published == twin.trust.published[lane]
            assert (np.asarray(estimator.lower) <= record.p).all() and (record.p <= np.asarray(estimator.upper)).all()
            assert np.isfinite(record.sums).all()
        found.append(Lane(record, core, twin))
    return found
