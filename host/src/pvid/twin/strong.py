"""Twin of strong_f32.c: samples in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.native import EstimatorConfig, Reason, StrongConfig
from pvid.twin import kapitza_strong as model
from pvid.twin.differentiator import derivatives
from pvid.twin.estimator import Estimator

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]


@dataclass
class TwinRecord:
    """State after every tick: p [ticks, 3, lanes], sums [ticks, n, lanes], reason [ticks, lanes]."""

    p: Float32
    sums: Float32
    reason: npt.NDArray[np.uint8]


class StrongTwin:
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
        self.estimator = Estimator(estimators or [config.estimator], config.sample_rate)

    def rows(self, phi: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Float32, Float32, Mask, Mask]:
        """N [ticks, 11], Y [ticks], whether a tick has a row, and whether its sample was finite."""
        phi32 = np.asarray(phi, np.float32)
        y32 = np.asarray(y, np.float32)
        finite = np.isfinite(phi32) & np.isfinite(y32)
        bank = (self.config.weights.astype(np.float32), self.config.stride, self.config.sample_rate)
        d_phi, ready = derivatives(phi32, finite, *bank)
        d_y, _ = derivatives(y32, finite, *bank)
        inverse_l1 = np.float32(1) / np.float32(self.config.l1)
        n, row_y = model.rows(d_phi, d_y[:, 2:5] * inverse_l1)
        return n, row_y, ready, finite

    def run(
        self,
        phi: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        sums: bool = True,
        progress: Callable[[int], None] | None = None,
    ) -> TwinRecord:
        """Steps all lanes through a run from its first sample: phi [rad], y [m], both [ticks]."""
        n, row_y, ready, finite = self.rows(phi, y)
        return run_rows(self.estimator, n, row_y, ready=ready, finite=finite, sums=sums, progress=progress)


def run_rows(
    estimator: Estimator,
    n: Float32,
    y: Float32,
    *,
    ready: Mask | None = None,
    finite: Mask | None = None,
    sums: bool = True,
    progress: Callable[[int], None] | None = None,
) -> TwinRecord:
    """Steps an estimator through rows N [ticks, 11], Y [ticks] that all lanes share."""
    ticks = len(y)
    lanes = estimator.p.shape[1]
    record = TwinRecord(
        p=np.empty((ticks, model.N_P, lanes), np.float32),
        sums=np.empty((ticks if sums else 0, model.SUMS, lanes), np.float32),
        reason=np.empty((ticks, lanes), np.uint8),
    )
    wide_n = np.broadcast_to(n[:, :, None], (ticks, model.N_THETA, lanes))
    wide_y = np.broadcast_to(y[:, None], (ticks, lanes))
    for tick in range(ticks):
        if finite is not None and not finite[tick]:
            estimator.counters["rejected_not_finite"] += 1
            record.reason[tick] = Reason.REJECTED_NOT_FINITE
        elif ready is not None and not ready[tick]:
            record.reason[tick] = Reason.WARMING_UP
        else:
            record.reason[tick] = estimator.step(wide_n[tick], wide_y[tick])
        record.p[tick] = estimator.p
        if sums:
            record.sums[tick] = estimator.sums
        if progress is not None and tick % 512 == 0:
            progress(tick)
    return record


def lanes_of(config: EstimatorConfig, starts: npt.ArrayLike) -> list[EstimatorConfig]:
    """One configuration a start, from starts [lanes, 3]; start_sd is half of each start."""
    return [
        replace(config, start=np.asarray(s, np.float32), start_sd=np.float32(0.5) * np.asarray(s, np.float32))
        for s in np.asarray(starts)
    ]
