"""theta(p) and its Jacobian for each row kind, and steps of p: in logarithms where p is positive, limited, and on the
manifold of the model's constraints (theory.md 4, (6b))."""

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

_MET = 1e-11  # a constraint is met where a step of this size would meet it
_RETURNS = 40  # Newton steps to the manifold at most
REDUNDANT = 1e-7  # what a constraint adds to the others, below which it adds nothing


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

    @cached_property
    def _constraints(self) -> Any:
        own = [self.model.with_knowns(one) for one in self.model.constraints]
        p = self.model.p
        slopes = [[sp.diff(one, symbol) for symbol in p] for one in own]
        return numpy_function(p, [own, slopes, [[[sp.diff(a, other) for other in p] for a in one] for one in slopes]])

    def constraints(self, p: Float) -> tuple[Float, Float]:
        """h [m] and A = dh/d(step) [m, n_p], each divided by the length of its gradient."""
        values, slopes, _ = self._constraints(*p)
        a = np.asarray(slopes, np.float64) * self.unit(p)
        length = np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-300)
        return np.asarray(values, np.float64) / length[:, 0], a / length

    def curvature(self, p: Float, reactions: Float) -> Float:
        """sum of reactions [m] times d2 h / d(step)^2 [n_p, n_p], the constraints as in `constraints`."""
        _, slopes, bends = (np.asarray(one, np.float64) for one in self._constraints(*p))
        unit = self.unit(p)
        share = reactions / np.maximum(np.linalg.norm(slopes * unit, axis=1), 1e-300)
        of_logarithm = np.diag(np.where(self.positive, share @ slopes * unit, 0.0))
        return np.asarray(np.einsum("m,mij->ij", share, bends) * np.outer(unit, unit) + of_logarithm)

    def tangent(self, p: Float, held: npt.NDArray[np.bool_] | None = None) -> Float | None:
        """T, an orthonormal base of the steps that keep all constraints and move none of `held` [n_p, free]; None where
        every step does. Redundant constraints do no harm."""
        if not self.model.constraints:
            return None
        a = self.constraints(p)[1]
        a = a if held is None else np.vstack([a, np.eye(len(p))[held]])
        _, sizes, directions = np.linalg.svd(a)
        return np.asarray(directions[int(np.sum(sizes > REDUNDANT)) :].T)

    def free(self, p: Float) -> int:
        """Parameters less constraints."""
        tangent = self.tangent(p)
        return len(p) if tangent is None else tangent.shape[1]

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
        found = self._returned(np.clip(p, self.low, self.high))
        if not np.isfinite(found).all():
            raise PvidError(
                f"{self.model.name}: no values near the start meet its constraints: do these contradict each other, or "
                "the ranges of the unknowns?"
            )
        if self.free(found) == 0:
            raise PvidError(f"{self.model.name}: the constraints leave no parameter to identify")
        return found

    def moved(self, p: Float, step: Float) -> Float:
        """p after a step in logarithms and values, within its bounds and on the constraints; NaN where there is no way
        back to these."""
        return self._returned(self._stepped(p, step))

    def _stepped(self, p: Float, step: Float) -> Float:
        moved = np.where(self.positive, p * np.exp(np.where(self.positive, step, 0.0)), p + step)
        return np.clip(moved, self.low, self.high)

    def _returned(self, p: Float) -> Float:
        """p on the constraints, by Newton steps of least norm."""
        for _ in range(_RETURNS if self.model.constraints else 0):
            g, a = self.constraints(p)
            if not np.isfinite(a).all():
                break
            held = np.zeros(len(p), np.bool_)
            for _ in range(len(p)):  # what a bound holds
                step = -np.linalg.pinv(a * ~held, rcond=REDUNDANT) @ g
                blocked = self.blocked(p, step) & ~held
                if not blocked.any():
                    break
                held |= blocked
            if np.max(np.abs(g)) <= _MET:
                return p
            p = self._stepped(p, step * min(1.0, 1.0 / max(float(np.max(np.abs(step / self.reach()))), 1e-300)))
        return np.full(len(p), np.nan) if self.model.constraints else p

    def room(self, p: Float) -> tuple[Float, Float]:
        """Least and largest step to the bounds [n_p]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (
                np.where(self.positive, np.log(np.maximum(one, 0) / p), one - p) for one in (self.low, self.high)
            )
        return np.minimum(low, 0.0), np.maximum(high, 0.0)

    def blocked(self, p: Float, force: Float) -> npt.NDArray[np.bool_]:
        """Which are at a bound that a force [n_p], the gradient downhill, holds them to."""
        return ((p <= self.low) & (force < 0)) | ((p >= self.high) & (force > 0))

    def prior(self, start: Float) -> Float:
        """Information of the start in units of a step, diagonal [n_p]: weak, it only bounds what no row tells."""
        width = np.where(self.positive, np.maximum(self.sd / np.where(self.positive, start, 1.0), 1.0), self.sd)
        for place, one in enumerate(self.model.p):
            width[place] = self.model.anchors.get(one, width[place])
        return np.asarray(1 / width**2)

    def reach(self) -> Float:
        """A step of this size is a large one [n_p]."""
        return np.where(self.positive, 1.0, self.sd)
