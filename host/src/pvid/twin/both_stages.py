"""Twin of an identifier with its second stage: weak_f32.c with refine_f32.c behind it, and refine_best_f32.c."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason, Stage
from pvid.twin.record import Reasons
from pvid.twin.refine import RefineTwin
from pvid.twin.weak import WeakTwin

_NEW = (Reason.UPDATED, Reason.MISFIT, Reason.HELD_UNCERTAIN)  # the weak form has a new estimate


class BothStagesTwin:
    """Both stages, of one lane.

    Parameters
    ----------
    weak, refine : just made; this steps both
    """

    def __init__(self, weak: WeakTwin, refine: RefineTwin) -> None:
        self.weak, self.refine = weak, refine

    def follow(self, samples: npt.ArrayLike, after: Callable[[int, Reasons], None]) -> Reasons:
        """As WeakTwin's; `after` is called when both stages have had the tick."""
        given = np.asarray(samples, np.float32)
        none = np.full(len(self.weak.estimator.p), np.nan, np.float32)

        def both(tick: int, reasons: Reasons) -> None:
            p = se = none
            if reasons[0] in _NEW:
                candidate = self.weak.finish.candidate[0]
                p, se = (candidate[name][: len(none)] for name in ("p", "se"))
            with np.errstate(all="ignore"):
                self.refine.step(given[tick], p, se, self.weak.busy)
            after(tick, reasons)

        return self.weak.follow(given, both)

    def best(self) -> tuple[Stage, np.void]:
        """pvid_refine_best_f32: whose estimate is published, and the estimate."""
        estimate: np.void = self.weak.trust.estimate[0].copy()
        refined = self.refine.estimate
        if refined is None:
            return Stage.WEAK, estimate
        place = np.array(self.refine.shape.place_of_p)
        n = len(place)
        scale = np.where(self.refine.steps.logarithmic[place], refined.r[place], np.float32(1))
        upper = np.triu(np.multiply.outer(scale, scale) * refined.covariance[np.ix_(place, place)])
        estimate["p"][:n], estimate["se"][:n] = refined.r[place], refined.se[place]
        covariance = estimate["covariance"]
        covariance[:n], covariance[:, :n] = 0, 0
        covariance[:n, :n] = upper + np.triu(upper, 1).T
        return Stage.REFINED, estimate
