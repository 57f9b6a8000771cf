"""theta(p) and its Jacobian for each row kind, and steps of p: in logarithms where p is positive, and limited."""

from __future__ import annotations

import copy
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.model.evaluation import numpy_function
from pvid.oracle.weak.functions import Float

# A standard error of a positive parameter beyond this part of it means that it may be 0, or that the run does not
# determine it.
UNKNOWN = 0.3


class Parameters:
    """The unknowns of a model."""

    def __init__(self, model: CompiledModel) -> None:
        self.model = model
        self.positive = np.array([one.positive for one in model.unknowns])
        self.guess = np.array([one.guess for one in model.unknowns], np.float64)
        self.sd = np.array([one.sd for one in model.unknowns], np.float64)
        self.names = model.p_names
        bounds = [(min(one.bounds[0], one.guess), max(one.bounds[1], one.guess)) for one in model.unknowns]
        self.low, self.high = (np.array(one, np.float64) for one in zip(*bounds, strict=True))

    def on_their_own_scale(self, which: npt.NDArray[np.bool_]) -> Parameters:
        """The same with some of the positive ones [n_p] in steps of their own value, which may be 0 or below."""
        out = copy.copy(self)
        out.positive = self.positive & ~which
        out.sd = np.where(which, self.guess, self.sd)
        out.low = np.where(which, -np.inf, self.low)
        return out

    @cached_property
    def _functions(self) -> list[tuple[Any, Any]]:
        p = list(self.model.p)
        out = []
        for row in self.model.rows:
            theta = [self.model.with_knowns(sp.sympify(one)) for one in row.theta]
            slopes = [[sp.diff(one, symbol) for symbol in p] for one in theta]
            out.append((numpy_function(p, theta), numpy_function(p, slopes)))
        return out

    def theta(self, p: Float) -> list[Float]:
        """Of each row kind."""
        return [np.asarray(f(*p), np.float64) for f, _ in self._functions]

    def jacobian(self, p: Float) -> list[Float]:
        """d theta / d(step) of each row kind [thetas, n_p]: by log p where p is positive."""
        unit = self.unit(p)
        return [np.asarray(f(*p), np.float64).reshape(-1, len(p)) * unit for _, f in self._functions]

    def unit(self, p: Float) -> Float:
        """What a step of 1 changes in p to first order: p itself where positive."""
        return np.where(self.positive, p, 1.0)

    def checked(self, start: Float | None) -> Float:
        """A start of the right length and signs; None: the guesses."""
        p = self.guess if start is None else np.asarray(start, np.float64)
        if p.shape != self.guess.shape:
            raise PvidError(f"{self.model.name} has {len(self.guess)} unknowns, the start has {p.size} values")
        for name, value, positive in zip(self.names, p, self.positive, strict=True):
            if not np.isfinite(value) or (positive and value <= 0):
                raise PvidError(f"{name} must start at a positive number, not {value:g}")
        return np.clip(p, self.low, self.high)

    def moved(self, p: Float, step: Float) -> Float:
        """p after a step in logarithms and values, within its bounds."""
        moved = np.where(self.positive, p * np.exp(np.where(self.positive, step, 0.0)), p + step)
        return np.clip(moved, self.low, self.high)

    def blocked(self, p: Float, force: Float) -> npt.NDArray[np.bool_]:
        """Which are at a bound that a force [n_p], the gradient downhill, holds them to."""
        return ((p <= self.low) & (force < 0)) | ((p >= self.high) & (force > 0))

    def prior(self, start: Float) -> Float:
        """Information of the start in units of a step, diagonal [n_p]: weak, it only bounds what no row tells."""
        width = np.where(self.positive, np.maximum(self.sd / np.where(self.positive, start, 1.0), 1.0), self.sd)
        return np.asarray(1 / width**2)

    def reach(self) -> Float:
        """A step of this size is a large one [n_p]."""
        return np.where(self.positive, 1.0, self.sd)
