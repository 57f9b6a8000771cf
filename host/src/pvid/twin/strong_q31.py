"""Twin of strong_q31.c: counts in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, StrongConfigQ31
from pvid.twin.kapitza import strong_q31 as model
from pvid.twin.kapitza.estimator_q31 import W_BITS, KapitzaEstimatorQ31
from pvid.twin.q31.differentiator import derivatives
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import Int, clamp, integers, round_shift, times_q31
from pvid.twin.q31.misfit import MisfitQ31
from pvid.twin.q31.scaled import scaled
from pvid.twin.record import After, Mask, Reasons, Recorder, Twin, TwinRecord
from pvid.twin.rows import follow_rows

DERIVATIVE_LIMIT = 2**30
RATE_LIMIT = 2**29


class StrongTwinQ31(Twin):
    """The strong-form identifier in several lanes that share samples and design."""

    def __init__(self, config: StrongConfigQ31, estimators: Sequence[EstimatorConfigQ31] | None = None) -> None:
        self.config = config
        self.estimator = KapitzaEstimatorQ31(estimators or [config.estimator], config.row)
        floor = self.estimator.expected_variance.shifted(-20).plus(scaled(1, 0))
        self.gate = GateQ31(config.gate, config.drive_ticks // 4, floor)
        forgetting = [one.forgetting_groups for one in estimators or [config.estimator]]
        self.misfit = MisfitQ31(config.drive_ticks, forgetting)

    def rows(self, phi: Int, y: Int) -> tuple[Int, Reasons]:
        """Rows [ticks, 13] and the reason of each tick: UPDATED if it has a row, ACCUMULATED within a block."""
        config, design = self.config, self.config.design
        phi = phi - config.phi_offset
        y = y - config.y_offset
        within = (np.abs(phi) <= design.bank.phi_max) & (np.abs(y) <= design.bank.y_max)
        d_phi, d_y, at = derivatives(phi, y, within, design.bank)
        u = model.accelerations(d_y, design.u_multiplier, design.u_shift)
        limits = np.array([RATE_LIMIT, DERIVATIVE_LIMIT, DERIVATIVE_LIMIT])
        usable = at.ready & ((u >= -limits) & (u < limits)).all(axis=1)
        u[~usable] = 0
        rows, fits = model.rows(design.row, d_phi, u)
        driven = self._driven(u[:, 0], usable)
        row_reason = np.full(len(phi), Reason.UPDATED, np.uint8)
        row_reason[~fits] = Reason.REJECTED_SATURATED
        row_reason[~driven] = Reason.HELD_NOT_EXCITED
        if self.frozen is not None:
            row_reason[self.frozen] = Reason.HELD_FROZEN
        row_reason[~usable] = Reason.REJECTED_SATURATED
        row_reason[~at.ready] = Reason.ACCUMULATED
        row_reason[~at.full] = Reason.WARMING_UP
        row_reason[~within] = Reason.REJECTED_SATURATED
        return rows, row_reason

    def _driven(self, u: Int, usable: Mask) -> Mask:
        """Whether the mean square of u over about a second reaches its threshold [ticks]."""
        threshold = self.config.drive_min**2
        forgetting = integers((2**31 - 1) // self.config.drive_ticks)
        mean_square = integers(0)
        driven = np.zeros(len(u), np.bool_)
        for tick in np.flatnonzero(usable):
            mean_square = clamp(mean_square + times_q31(u[tick] * u[tick] - mean_square, forgetting), 1 << 60)
            driven[tick] = mean_square >= threshold
        return driven

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely."""
        return self.config.design.bank.window

    def step(self, row: Int) -> Reasons:
        """A row of all lanes."""
        return step(self.estimator, row, self.gate, self.misfit)

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """See Twin."""
        return follow_rows(self.estimator, self.step, *self.rows(integers(phi), integers(y)), after)


def run_rows(estimator: KapitzaEstimatorQ31, rows: Int) -> TwinRecord:
    """Steps an estimator through rows [ticks, 13] without gate and verdict."""
    recorder = Recorder(estimator, len(rows))
    return recorder.finished(follow_rows(estimator, partial(step, estimator), rows, None, recorder))


def step(
    estimator: KapitzaEstimatorQ31, row: Int, gate: GateQ31 | None = None, misfit: MisfitQ31 | None = None
) -> Reasons:
    """Adds a row and solves if a solve is due; all lanes must accept the same rows."""
    e, gradient, fits = estimator.innovation(row)
    if not fits.all():
        if fits.any():
            raise PvidError("lanes of one twin must take the same rows in: step those that do not apart")
        estimator.counters["rejected_saturated"] += 1
        return np.full(estimator.lanes, Reason.REJECTED_SATURATED, np.uint8)
    if misfit is not None:
        misfit.take(e * e, round_shift(gradient[0] * estimator.p[0], W_BITS))
    if gate is not None and gate.is_on:
        passes = gate.passes(scaled(e * e, 0), fits)
        if passes.any() != passes.all():
            raise PvidError("lanes of one twin must accept the same rows: their estimates differ too much")
        if not passes.all():
            estimator.counters["rejected_outlier"] += 1
            return np.full(estimator.lanes, Reason.REJECTED_OUTLIER, np.uint8)
    reason = estimator.take(row, e, gradient)
    if misfit is None:
        return reason
    doubted = misfit.alarm & (reason == Reason.UPDATED)
    estimator.counters["misfits"] += doubted
    return np.where(doubted, np.uint8(Reason.MISFIT), reason)
