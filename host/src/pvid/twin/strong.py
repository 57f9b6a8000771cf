"""Twin of strong_f32.c: samples in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig, StrongConfig
from pvid.twin.f32.differentiator import derivatives
from pvid.twin.f32.estimator import Estimator
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.misfit import Misfit
from pvid.twin.kapitza import strong as model

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]


@dataclass
class TwinRecord:
    """State after every tick: p and, in the weak form, published [ticks, n_p, lanes], sums [ticks, n, lanes], reason
    [ticks, lanes]."""

    p: Float32
    sums: Float32
    reason: npt.NDArray[np.uint8]
    published: Float32


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
        self.frozen: Mask | None = None  # [ticks], to be set before a run
        rate = np.float32(config.sample_rate)
        floor = np.float32(1e-6) * self.estimator.row_variance
        self.gate = Gate(config.gate, rate, np.float32(0.25) * rate, floor)
        settings = estimators or [config.estimator]
        self.misfit = Misfit(rate, np.array([one.forgetting_s for one in settings], np.float32))

    def rows(self, phi: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Float32, Float32, Reasons]:
        """N [ticks, 11], Y [ticks] and the fate of each tick: ACCUMULATED where there is a row to take in."""
        phi32 = np.asarray(phi, np.float32)
        y32 = np.asarray(y, np.float32)
        finite = np.isfinite(phi32) & np.isfinite(y32)
        bank = (self.config.weights.astype(np.float32), self.config.stride, self.config.sample_rate)
        d_phi, ready = derivatives(phi32, finite, *bank)
        d_y, _ = derivatives(y32, finite, *bank)
        u = d_y[:, 2:5] * (np.float32(1) / np.float32(self.config.l1))
        n, row_y = model.rows(d_phi, u)
        row_reason = np.full(len(phi32), Reason.ACCUMULATED, np.uint8)
        row_reason[ready & ~self._driven(u[:, 0], ready)] = Reason.HELD_NOT_EXCITED
        if self.frozen is not None:
            row_reason[self.frozen] = Reason.HELD_FROZEN
        row_reason[~ready] = Reason.WARMING_UP
        row_reason[~finite] = Reason.REJECTED_NOT_FINITE
        return n, row_y, row_reason

    def _driven(self, u: Float32, ready: Mask) -> Mask:
        """Where the mean square of u [ticks] over about a second reaches its threshold."""
        rate = np.float32(self.config.sample_rate)
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

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: Callable[[int, Reasons], None]) -> Reasons:
        """Like `run`, keeping nothing: `after` is called after every tick, when the state is that tick's.

        Returns what every tick told, [ticks, lanes].
        """
        n, row_y, row_reason = self.rows(phi, y)
        return follow_rows(self.estimator, n, row_y, row_reason, after, self.gate, self.misfit)

    def run(
        self,
        phi: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        sums: bool = True,
        progress: Callable[[int], None] | None = None,
    ) -> TwinRecord:
        """Steps all lanes through a run from its first sample: phi [rad], y [m], both [ticks]."""
        n, row_y, row_reason = self.rows(phi, y)
        return run_rows(
            self.estimator,
            n,
            row_y,
            row_reason=row_reason,
            sums=sums,
            progress=progress,
            gate=self.gate,
            misfit=self.misfit,
        )


def run_rows(
    estimator: Estimator,
    n: Float32,
    y: Float32,
    *,
    row_reason: Reasons | None = None,
    sums: bool = True,
    progress: Callable[[int], None] | None = None,
    gate: Gate | None = None,
    misfit: Misfit | None = None,
) -> TwinRecord:
    """Steps an estimator through rows N [ticks, 11], Y [ticks] that all lanes share, or with an axis of lanes more.

    `fate` [ticks] tells what became of a tick before it reached the estimator; by default all have a row.
    """
    ticks = len(y)
    lanes = estimator.p.shape[1]
    p = np.empty((ticks, model.N_P, lanes), np.float32)
    state = np.empty((ticks if sums else 0, model.SUMS, lanes), np.float32)

    def record(tick: int, _: Reasons) -> None:
        p[tick] = estimator.p
        if sums:
            state[tick] = estimator.sums
        if progress is not None and tick % 512 == 0:
            progress(tick)

    reason = follow_rows(estimator, n, y, row_reason, record, gate, misfit)
    return TwinRecord(p=p, sums=state, reason=reason, published=np.empty((0, model.N_P, lanes), np.float32))


def follow_rows(
    estimator: Estimator,
    n: Float32,
    y: Float32,
    row_reason: Reasons | None,
    after: Callable[[int, Reasons], None],
    gate: Gate | None = None,
    misfit: Misfit | None = None,
) -> Reasons:
    """Like `run_rows`, keeping nothing: `after` is called after every tick, when the state is that tick's.

    Returns what every tick told, [ticks, lanes].
    """
    ticks = len(y)
    lanes = estimator.p.shape[1]
    reason = np.empty((ticks, lanes), np.uint8)
    wide_n = np.broadcast_to(n if n.ndim == 3 else n[:, :, np.newaxis], (ticks, model.N_THETA, lanes))
    wide_y = np.broadcast_to(y if y.ndim == 2 else y[:, np.newaxis], (ticks, lanes))
    for tick in range(ticks):
        if row_reason is None or row_reason[tick] == Reason.ACCUMULATED:
            reason[tick] = estimator.step(wide_n[tick], wide_y[tick], gate, misfit)
        else:
            reason[tick] = row_reason[tick]
            if row_reason[tick] not in (Reason.WARMING_UP, Reason.HELD_FROZEN):
                estimator.counters[Reason(row_reason[tick]).name.lower()] += 1
        after(tick, reason[tick])
    return reason


def lanes_of(config: EstimatorConfig, starts: npt.ArrayLike) -> list[EstimatorConfig]:
    """One configuration a start, from starts [lanes, 3]; start_sd is half of each start."""
    return [
        replace(config, start=np.asarray(s, np.float32), start_sd=np.float32(0.5) * np.asarray(s, np.float32))
        for s in np.asarray(starts)
    ]
