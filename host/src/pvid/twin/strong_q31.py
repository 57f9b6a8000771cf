"""Twin of strong_q31.c: counts in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, StrongConfigQ31
from pvid.twin.kapitza import strong_q31 as model
from pvid.twin.q31.differentiator import derivatives
from pvid.twin.q31.estimator import EstimatorQ31
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import Int, clamp, integers, times_q31
from pvid.twin.q31.misfit import MisfitQ31
from pvid.twin.q31.scaled import scaled
from pvid.twin.record import After, Mask, Reasons, Twin
from pvid.twin.rows import follow_rows

DERIVATIVE_LIMIT = 2**30


class StrongTwinQ31(Twin):
    """The strong-form identifier in several lanes that share samples and design."""

    def __init__(self, config: StrongConfigQ31, estimators: Sequence[EstimatorConfigQ31] | None = None) -> None:
        self.config = config
        self.estimator = EstimatorQ31(estimators or [config.estimator], model.STRONG)
        floor = self.estimator.expected_variance.shifted(-20).plus(scaled(1, 0))
        self.gate = GateQ31(config.gate, config.drive_ticks // 4, floor)
        forgetting = [one.forgetting_groups for one in estimators or [config.estimator]]
        self.misfit = MisfitQ31(config.drive_ticks, forgetting)

    def rows(self, phi: Int, y: Int) -> tuple[Int, Int, Reasons]:
        """N [ticks, 11], Y [ticks] and the reason of each tick: ACCUMULATED if it has a row."""
        config, design = self.config, self.config.design
        phi = phi - config.phi_offset
        y = y - config.y_offset
        within = (np.abs(phi) <= design.bank.phi_max) & (np.abs(y) <= design.bank.y_max)
        d_phi, d_y, ready = derivatives(phi, y, within, design.bank)
        u = model.accelerations(d_y, design.u_multiplier, design.u_shift)
        usable = ready & (np.abs(u) <= DERIVATIVE_LIMIT).all(axis=1)
        u[~usable] = 0
        n, row_y, fits = model.rows(design.row, d_phi, u)
        driven = self._driven(u[:, 0], usable)
        row_reason = np.full(len(phi), Reason.ACCUMULATED, np.uint8)
        row_reason[~fits] = Reason.REJECTED_SATURATED
        row_reason[~driven] = Reason.HELD_NOT_EXCITED
        if self.frozen is not None:
            row_reason[self.frozen] = Reason.HELD_FROZEN
        row_reason[~usable] = Reason.REJECTED_SATURATED
        row_reason[~ready] = Reason.WARMING_UP
        row_reason[~within] = Reason.REJECTED_SATURATED
        return n, row_y, row_reason

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

    def step(self, n: Int, y: Int) -> Reasons:
        """A row of all lanes."""
        return step(self.estimator, n, y, self.gate, self.misfit)

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """See Twin."""
        return follow_rows(self.estimator, self.step, *self.rows(integers(phi), integers(y)), after)


def step(
    estimator: EstimatorQ31, n: Int, y: Int, gate: GateQ31 | None = None, misfit: MisfitQ31 | None = None
) -> Reasons:
    """Adds a row and solves if a solve is due; the gate must accept the same rows in all lanes."""
    terms, e, fits = estimator.terms(n, y)
    held = np.where(fits, e, 0)
    if misfit is not None and fits.all():
        misfit.take(held * held, model.sensitivity(terms))
    if gate is not None and gate.is_on:
        passes = gate.passes(scaled(held * held, 0), fits)
        if passes.any() != passes.all():
            raise PvidError("lanes of one twin must accept the same rows: their estimates differ too much")
        if not passes.all():
            estimator.counters["rejected_outlier"] += 1
            return np.full(estimator.lanes, Reason.REJECTED_OUTLIER, np.uint8)
    reason = estimator.take_row(n, e, fits)
    taken = reason == Reason.ACCUMULATED
    if not taken.any():
        return reason
    if not taken.all():
        raise PvidError("lanes of one twin must take the same rows in: step those that do not apart")
    for reported in estimator.solve(ends_group=True):
        reason = reason if reported is None else reported
    if misfit is None:
        return reason
    doubted = misfit.alarm & (reason == Reason.UPDATED)
    estimator.counters["misfits"] += doubted
    return np.where(doubted, np.uint8(Reason.MISFIT), reason)
