"""What the newest estimate predicts for the motion of the last seconds: beside the measured signals on the live page.

The equations of a shipped mechanism are simulated in blocks (identification/validation.py) in a thread of its own, at
most once in `PERIOD_S`: a second of processor time. A mechanism of the user's own has its model file where its board is
made, not here: it is not simulated.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.log.history import History
from pvid.models.registry import names

if TYPE_CHECKING:
    from pvid.identification.validation import Validation
    from pvid.model.compiled import CompiledModel

Float = npt.NDArray[np.float64]

PERIOD_S = 10.0
_LONGEST_GAP = 1.5  # of the median time between samples


class LiveSimulation:
    """The newest simulation. `offer` and `at` return at once."""

    def __init__(self) -> None:
        self._began = -math.inf
        self._busy: threading.Thread | None = None
        self._newest: Validation | None = None

    @property
    def words(self) -> str:
        """How well the estimate predicts the last seconds; empty before the first simulation, and where no sensor is
        predicted better than by its mean."""
        found = self._newest
        told = [] if found is None else [one for one in found.sensors if one.r2 > 0]
        return f"{listed(told)} (at {found.t[-1]:.0f} s)" if found is not None and told else ""

    def offer(self, history: History, t: Float, signals: list[Float]) -> None:
        """Starts a simulation of samples [n] at t [n, s] with the newest estimate, if one is due."""
        now = time.monotonic()
        if now < self._began + PERIOD_S or (self._busy is not None and self._busy.is_alive()):
            return
        mechanism = history.mechanism
        if mechanism.name not in names() or not history.newest or len(t) < 100:
            return
        self._began = now
        samples = dict(zip((one.name for one in mechanism.samples), signals, strict=True))
        given = (mechanism.name, mechanism.known, t, samples, dict(history.published))
        self._busy = threading.Thread(target=self._simulate, args=given, daemon=True)
        self._busy.start()

    def at(self, name: str, t: Float) -> Float | None:
        """The simulated sensor at t [n], NaN where there is none; None: it is not simulated."""
        found = self._newest
        if found is None or name not in found.simulated:
            return None
        inside = (t >= found.t[0]) & (t <= found.t[-1])
        return np.where(inside, np.interp(t, found.t, found.simulated[name]), np.nan)

    def _simulate(
        self, name: str, known: Mapping[str, float], t: Float, samples: Mapping[str, Float], newest: Mapping[str, float]
    ) -> None:
        from pvid.identification.validation import predicted  # loads SymPy
        from pvid.rig.mechanism_file import MechanismRig
        from pvid.rig.run import Recording

        step = float(np.median(np.diff(t)))
        breaks = np.flatnonzero(np.diff(t) > _LONGEST_GAP * step)
        part = slice(int(breaks[-1]) + 1 if len(breaks) else 0, None)
        if step <= 0:
            return
        with suppress(PvidError, np.linalg.LinAlgError):
            model = MechanismRig(name, known=known).compiled()
            run = Recording(t[part], {key: x[part] for key, x in samples.items()}, 1.0 / step)
            self._newest = predicted(model, run, _values(model, newest), None)


def _values(model: CompiledModel, newest: Mapping[str, float]) -> dict[str, float | None]:
    """Of every parameter; an offset that is not estimated is that of the guess."""
    found: dict[str, float | None] = {}
    for one in model.unknowns:
        value = newest.get(one.name, math.nan)
        found[one.name] = value if math.isfinite(value) else None if one.positive else one.guess
    return found
