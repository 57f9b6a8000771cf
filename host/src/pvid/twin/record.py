"""Common part of the four twins: they step through a run and record the state after every tick."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.record import Array, Record

Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]
After = Callable[[int, Reasons], None]
Progress = Callable[[int], None]

_PROGRESS_TICKS = 512
# Of pvid_counters.
COUNTERS = (
    "rows",
    "updates",
    "limited",
    "bounded",
    "held_not_excited",
    "held_singular",
    "rejected_not_finite",
    "rejected_saturated",
    "held_uncertain",
    "held_out_of_range",
    "misfits",
    "rejected_outlier",
    "in_dead_zone",
)


def of_all_lanes(accepted: Mask) -> bool:
    """Whether the lanes accept a window [lanes].

    Raises
    ------
    PvidError
        When they differ: lanes of one twin share the schedule.
    """
    if accepted.any() != accepted.all():
        raise PvidError("lanes of one twin must accept the same windows: their estimates differ too much")
    return bool(accepted.all())


@dataclass
class TwinRecord:
    """State after every tick in every lane: p and published [ticks, n_p, lanes], sums [ticks, n, lanes], exponent of
    the sums and reason [ticks, lanes]. Published: by the weak form, else empty; exponents: in fixed point, else empty.
    """

    p: Array
    sums: Array
    reason: Reasons
    exponent: Reasons
    published: Array

    def lane(self, lane: int = 0) -> Record:
        """A copy of one lane."""
        parts = (self.p, self.sums, self.reason, self.exponent, self.published)
        return Record(*(np.ascontiguousarray(part[..., lane]) for part in parts))


class Recorder:
    """Records an estimator's state and the published p after every tick: float32, or in fixed point int32 and int64."""

    def __init__(
        self, estimator: Any, ticks: int, sums: bool = True, progress: Progress | None = None, trust: Any = None
    ) -> None:
        (n_p, lanes), fixed = estimator.p.shape, estimator.p.dtype.kind != "f"
        number, wide = (np.int32, np.int64) if fixed else (np.float32, np.float32)
        self._estimator, self._trust, self._progress, self._sums = estimator, trust, progress, sums
        self._record = TwinRecord(
            p=np.empty((ticks, n_p, lanes), number),
            sums=np.empty((ticks if sums else 0, len(estimator.sums), lanes), wide),
            reason=np.empty((0, lanes), np.uint8),
            exponent=np.empty((ticks if fixed else 0, lanes), np.uint8),
            published=np.empty((ticks if trust is not None else 0, n_p, lanes), number),
        )

    def __call__(self, tick: int, _: Reasons) -> None:
        record, estimator = self._record, self._estimator
        record.p[tick] = estimator.p
        if self._sums:
            record.sums[tick] = estimator.sums
        if len(record.exponent):
            record.exponent[tick] = estimator.exponent
        if self._trust is not None:
            record.published[tick] = self._trust.estimate["p"][:, : len(estimator.p)].T
        if self._progress is not None and tick % _PROGRESS_TICKS == 0:
            self._progress(tick)

    def finished(self, reason: Reasons) -> TwinRecord:
        """The record with the reasons [ticks, lanes]."""
        self._record.reason = reason
        return self._record


class Twin(ABC):
    """An identifier in several lanes that share samples, tables and rate. `frozen` [ticks] is set before a run."""

    estimator: Any
    trust: Any = None
    frozen: Mask | None = None

    @property
    @abstractmethod
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely."""

    @abstractmethod
    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """Like `run` without a record: calls `after` after every tick.

        Returns the reason of every tick [ticks, lanes].
        """

    def run(
        self, phi: npt.ArrayLike, y: npt.ArrayLike, *, sums: bool = True, progress: Progress | None = None
    ) -> TwinRecord:
        """Steps all lanes through a run from its first sample: phi [rad], y [m], both [ticks]; or counts."""
        recorder = Recorder(self.estimator, np.size(phi), sums, progress, self.trust)
        return recorder.finished(self.follow(phi, y, recorder))
