"""Twin of strong_f32.c: samples in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig, StrongConfig
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.misfit import Misfit
from pvid.twin.kapitza import strong as model
from pvid.twin.kapitza import window
from pvid.twin.kapitza.strong_estimator import StrongEstimator
from pvid.twin.record import After, Mask, Reasons, Twin
from pvid.twin.rows import follow_rows

Float32 = npt.NDArray[np.float32]


class StrongTwin(Twin):
    """The strong-form identifier in several lanes that share samples, bank and rate.

    Parameters
    ----------
    config
        Bank, rate and l1; its estimator settings are used when `estimators` is not given.
    estimators
        Settings of each lane.
    """

    def __init__(self, config: StrongConfig, estimators: Sequence[EstimatorConfig] | None = None) -> None:
        self.config = config
        self._rate = np.float32(config.sample_rate) / np.float32(config.every)  # of rows
        self.estimator = self._rows = StrongEstimator(
            estimators or [config.estimator], float(self._rate), config.exact_every
        )
        rate = self._rate
        floor = np.float32(1e-6) * self.estimator.row_variance
        self.gate = Gate(config.gate, rate, np.float32(0.25) * rate, floor)
        settings = estimators or [config.estimator]
        self.misfit = Misfit(rate, np.array([one.forgetting_s for one in settings], np.float32))

    def rows(self, phi: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Float32, Reasons]:
        """Rows [ticks, 6] and the reason of each tick: UPDATED if it has a row, ACCUMULATED within a block."""
        phi32 = np.asarray(phi, np.float32)
        y32 = np.asarray(y, np.float32)
        finite = np.isfinite(phi32) & np.isfinite(y32)
        d_phi, u, at = window.derivatives(self.config, phi32, y32, finite)
        row_reason = np.full(len(phi32), Reason.UPDATED, np.uint8)
        row_reason[at.ready & ~self._driven(u[:, 0], at.ready)] = Reason.HELD_NOT_EXCITED
        if self.frozen is not None:
            row_reason[self.frozen] = Reason.HELD_FROZEN
        row_reason[~at.ready] = Reason.ACCUMULATED
        row_reason[~at.full] = Reason.WARMING_UP
        row_reason[~finite] = Reason.REJECTED_NOT_FINITE
        return model.rows(d_phi, u), row_reason

    def _driven(self, u: Float32, ready: Mask) -> Mask:
        """Whether the mean square of u over about a second reaches its threshold [ticks]."""
        rate = self._rate
        forgetting = np.float32(1) / rate if rate > 1 else np.float32(1)
        threshold = np.float32(self.config.drive_min) * np.float32(self.config.drive_min)
        mean_square = np.float32(0)
        driven = np.zeros(len(u), np.bool_)
        with np.errstate(all="ignore"):
            squares = u * u
            for tick in np.flatnonzero(ready):
                moved = mean_square + forgetting * (squares[tick] - mean_square)
                mean_square = moved if np.isfinite(moved) else mean_square
                driven[tick] = mean_square >= threshold
        return driven

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely."""
        return self.config.window

    def step(self, row: Float32) -> Reasons:
        """A row of all lanes [6, lanes]."""
        return self._rows.row(row, self.gate, self.misfit)

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """See Twin."""
        rows, row_reason = self.rows(phi, y)
        of_all_lanes = np.broadcast_to(rows[:, :, None], (*rows.shape, self.estimator.p.shape[1]))
        return follow_rows(self.estimator, self.step, of_all_lanes, row_reason, after)


def lanes_of(config: EstimatorConfig, starts: npt.ArrayLike) -> list[EstimatorConfig]:
    """One configuration a start, from starts [lanes, 3]; start_sd is half of each start."""
    return [
        replace(config, start=np.asarray(s, np.float32), start_sd=np.float32(0.5) * np.asarray(s, np.float32))
        for s in np.asarray(starts)
    ]
