"""The equations of a mechanism about its rest: natural rates, and how strongly each drive acts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.model.evaluation import numpy_function
from pvid.sim.motion import Motion, motion_of

Float = npt.NDArray[np.float64]

_NEWTON = 30
_STEP = 1e-6  # of a derivative
_AT_REST = 1e-6  # largest rate of a state of rest
_NONE = 1e-6  # of the largest rate: a motion without a rate of its own, as of a shaft that turns
_RINGS = 1e-3  # imaginary part over the absolute value: it oscillates


@dataclass(frozen=True, eq=False)
class Linearised:
    """The equations without the signs of friction, at parameters and constants.

    Attributes
    ----------
    motion : of the mechanism
    values : unknowns and constants [n_p + n_knowns]
    system : A and r of A h = r, of states, inputs, constants and signs
    rates : x' of states, highest derivatives, inputs, constants and signs
    """

    motion: Motion
    values: Float
    system: Callable[..., Any]
    rates: Callable[..., Any]

    @classmethod
    def of(cls, model: CompiledModel, p: npt.ArrayLike, knowns: Mapping[str, float]) -> Linearised:
        """At parameters [n_p] and constants by name. Raises PvidError where the equations do not determine a motion."""
        motion = motion_of(model)
        known = [knowns.get(one.name, one.value) for one in model.knowns]
        symbols = [*motion.states, *motion.inputs, *motion.constants, *motion.signs]
        return cls(
            motion,
            np.array([*np.asarray(p, np.float64), *known]),
            numpy_function(symbols, [motion.matrix, motion.right]),
            numpy_function([*motion.highest, *symbols], list(motion.rates)),
        )

    def rest(self) -> Float:
        """The state of rest near 0, without inputs [nx]; 0 where none is found."""
        x = np.zeros(len(self.motion.states))
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON):
                rates, slopes = self._rates(x), self._slopes(x)
                if not (np.isfinite(rates).all() and np.isfinite(slopes).all()):
                    break
                x = x - np.linalg.lstsq(slopes, rates, rcond=1e-9)[0]
            rates = self._rates(x)
        return x if np.isfinite(rates).all() and np.abs(rates).max(initial=0.0) < _AT_REST else np.zeros(len(x))

    def natural_hz(self) -> tuple[float, float, bool] | None:
        """The slowest and the fastest natural rate at rest [Hz], of what oscillates, where anything does, and whether
        it does; None: there is none."""
        slopes = self._slopes(self.rest())
        if not slopes.size or not np.isfinite(slopes).all():
            return None
        rates = np.linalg.eigvals(slopes)
        size = np.abs(rates)
        own = size > _NONE * size.max()
        rings = own & (np.abs(rates.imag) > _RINGS * size)
        chosen = size[rings if rings.any() else own] / (2 * math.pi)
        return (float(chosen.min()), float(chosen.max()), bool(rings.any())) if len(chosen) else None

    def strength(self, signal: str, start: Mapping[str, float], faster: float) -> Float:
        """How strongly a drive of size 1 acts on each of the highest derivatives [n]: at rest, per unit of time of a
        motion that is so much faster; a drive that does nothing at rest, as a moving pivot, in relation to what moves
        the mechanism at a start."""
        rest, orders = self.rest(), np.array([float(jet.order) for jet in self.motion.highest])
        found = self._effect(signal, rest, faster)
        if found.any():
            return found / faster**orders
        x = np.array([start.get(str(symbol), 0.0) for symbol in self.motion.states])
        own = np.abs(self._highest(x))
        return np.divide(self._effect(signal, x, faster), own, out=np.zeros(len(own)), where=own > 0)

    def _effect(self, signal: str, x: Float, faster: float) -> Float:
        total = np.zeros(len(self.motion.highest))
        for place, jet in enumerate(self.motion.inputs):
            if jet.of == signal:
                u = np.zeros(len(self.motion.inputs))
                u[place] = faster**jet.order
                total += np.abs(self._highest(x, u) - self._highest(x))
        return total

    def _highest(self, x: Float, u: Float | None = None) -> Float:
        u = np.zeros(len(self.motion.inputs)) if u is None else u
        matrix, right = self.system(*x, *u, *self.values, *np.zeros(len(self.motion.signs)))
        return np.asarray(np.linalg.solve(np.array(matrix, np.float64), np.array(right, np.float64).ravel()))

    def _rates(self, x: Float) -> Float:
        u, signs = np.zeros(len(self.motion.inputs)), np.zeros(len(self.motion.signs))
        return np.array(self.rates(*self._highest(x), *x, *u, *self.values, *signs), np.float64)

    def _slopes(self, x: Float) -> Float:
        """d rates / d x [nx, nx]."""
        columns = [(self._rates(x + one) - self._rates(x - one)) / (2 * _STEP) for one in _STEP * np.eye(len(x))]
        return np.array(columns).T
