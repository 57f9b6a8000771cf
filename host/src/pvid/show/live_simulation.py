"""What the newest estimate predicts for the motion of the last seconds: beside the measured angle on the live page.

The pendulum is simulated (sim/simulated_angle.py) in a thread of its own, at most once in `PERIOD_S`: a second of
processor time. Other mechanisms are not simulated here.
"""

from __future__ import annotations

import math
import threading
import time
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.log.history import History
from pvid.models.kapitza.model import MODEL
from pvid.rig.run import Run
from pvid.sim.simulated_angle import SimulatedAngle, simulated_angle

Float = npt.NDArray[np.float64]

PERIOD_S = 10.0
_LONGEST_GAP = 1.5  # of the median time between samples
_MOST_UNEXPLAINED = 1.0  # of the variance: worse than no model


class LiveSimulation:
    """The newest simulation. `offer` and `at` return at once."""

    def __init__(self) -> None:
        self._began = -math.inf
        self._busy: threading.Thread | None = None
        self._newest: SimulatedAngle | None = None

    @property
    def words(self) -> str:
        """How well the estimate explains the last seconds; empty before the first simulation."""
        found = self._newest
        if found is None or found.unexplained > _MOST_UNEXPLAINED:
            return ""
        return f"R² {found.r2_words}, simulated angle off by {1e3 * found.rms:.2g} mrad rms (at {found.t[-1]:.0f} s)"

    def offer(self, history: History, t: Float, signals: list[Float]) -> None:
        """Starts a simulation of samples [n] at t [n, s] with the newest estimate, if one is due."""
        now = time.monotonic()
        constants = history.constants
        if now < self._began + PERIOD_S or (self._busy is not None and self._busy.is_alive()):
            return
        if history.model.name != MODEL.name or constants is None or not history.newest or len(t) < 100:
            return
        newest = history.published
        p = np.array([newest.get(name, math.nan) for name in history.model.mapped_names])
        offset = next(one.name for one in history.model.parameters if one.role == "offset")
        rest = newest.get(offset, math.nan)
        if not np.isfinite(p).all():
            return
        whole = np.append(p, rest) if math.isfinite(rest) else p
        self._began = now
        self._busy = threading.Thread(
            target=self._simulate, args=(t, signals[0], signals[1], whole, constants["l1"]), daemon=True
        )
        self._busy.start()

    def at(self, t: Float) -> Float | None:
        """The simulated angle at t [n], NaN where there is none; None before the first simulation."""
        found = self._newest
        if found is None:
            return None
        inside = (t >= found.t[0]) & (t <= found.t[-1])
        return np.where(inside, np.interp(t, found.t, found.simulated), np.nan)

    def _simulate(self, t: Float, phi: Float, y: Float, p: Float, l1: float) -> None:
        step = float(np.median(np.diff(t)))
        breaks = np.flatnonzero(np.diff(t) > _LONGEST_GAP * step)
        first = int(breaks[-1]) + 1 if len(breaks) else 0
        if step <= 0 or len(t) - first < 100:
            return
        with suppress(PvidError, np.linalg.LinAlgError):
            run = Run(t[first:], phi[first:], y[first:], 1.0 / step)
            self._newest = simulated_angle(run, p, l1)
