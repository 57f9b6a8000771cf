"""Strong form of any compiled model: every sample is a row, derivatives by Savitzky-Golay filters.

For comparison at its best: the search starts at the truth, the law of the friction is known, and the filter is the one
with the least error against the truth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy as sp
from scipy.signal import savgol_filter

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Part
from pvid.model.signals import Integral, jets, sgn, total_derivative
from pvid.oracle.weak.parameters import Parameters

Float = npt.NDArray[np.float64]
Run = Mapping[str, Float]

_STEPS = 40  # of Gauss-Newton, weights of the equations anew at each
_SETTLED = 1e-9  # a step below this ends the search
_STEP_LIMIT = 0.3
FILTERS = tuple((taps, degree) for taps in (11, 21, 31, 61, 101, 201) for degree in (4, 6))


@dataclass(frozen=True)
class Filter:
    """A polynomial of this degree over this many samples; of inputs that are held, the mean about a sample."""

    taps: int
    degree: int
    rate: float

    def derivative(self, x: Float, order: int) -> Float:
        """[n]"""
        if order > self.degree:
            raise PvidError(f"a polynomial of degree {self.degree} has no derivative of order {order}")
        return np.asarray(savgol_filter(x, self.taps, self.degree, deriv=order, delta=1 / self.rate))


def _about(held: Float) -> Float:
    """The mean of a held input about each sample, to fourth order."""
    wide = np.concatenate([[held[0]] * 2, held, [held[-1]]])
    return np.asarray((-wide[:-3] + 13 * wide[1:-2] + 13 * wide[2:-1] - wide[3:]) / 24)


class Samples:
    """Values of jets, running integrals and opaque signals at every sample."""

    def __init__(self, model: CompiledModel, run: Run, smoother: Filter) -> None:
        self.model, self.smoother = model, smoother
        self.raw = {one.name: _about(run[one.name]) if one.hold == "zoh" else run[one.name] for one in model.signals}
        for jet, expression in model.opaque.items():
            self.raw[jet.of] = self.value(sp.sympify(expression))

    def value(self, expression: sp.Expr) -> Float:
        """[n]"""
        bare, marks = expression, {}
        for one in sorted(expression.atoms(Integral), key=lambda one: -int(one.args[1])):
            marks[sp.Dummy()] = self._integral(one)
            bare = bare.xreplace({one: list(marks)[-1]})
        found = sorted(jets(bare), key=str)
        values = [self.smoother.derivative(self.raw[jet.of], jet.order) for jet in found]
        function = sp.lambdify([*found, *marks], self.model.with_knowns(bare), [{sgn.__name__: np.sign}, "numpy"])
        n = len(next(iter(self.raw.values())))
        return np.broadcast_to(np.asarray(function(*values, *marks.values()), np.float64), (n,))

    def _integral(self, one: sp.Expr) -> Float:
        x, folds = self.value(one.args[0]), int(one.args[1])
        for _ in range(folds):
            x = np.append(0.0, np.cumsum((x[1:] + x[:-1]) / 2)) / self.smoother.rate
        return x

    def column(self, part: Part) -> Float:
        """Sum of the derivatives of a part [n]; a term with a sign is differentiated by the filter."""
        total: sp.Expr = sp.Integer(0)
        signs = np.zeros(len(next(iter(self.raw.values()))))
        for order, psi in part.items():
            switching, smooth = sp.expand(psi).as_independent(sgn, as_Add=True)[::-1]
            total += total_derivative(smooth, order)
            if switching != 0:
                values = self.value(switching)
                signs = signs + (self.smoother.derivative(values, order) if order else values)
        return self.value(total) + signs


def fitted(model: CompiledModel, run: Run, smoother: Filter, start: Float) -> Float:
    """p [n_p] by Gauss-Newton; each equation is weighted with its residuals.

    Raises
    ------
    PvidError
        When a derivative is of too high an order, or a row has free columns.
    """
    if any(row.nuisances for row in model.rows):
        raise PvidError(f"{model.name} has rows with free columns: it has no strong form here")
    samples = Samples(model, run, smoother)
    inner = slice(smoother.taps, -smoother.taps)
    kinds = []
    for row in model.rows:
        columns = [samples.column(part)[inner] for part in (*row.regressors, row.known)]
        kinds.append((np.stack(columns[:-1]), columns[-1]))
    parameters = Parameters(model)
    p = start.copy()
    for _ in range(_STEPS):
        s, f = np.zeros((len(p), len(p))), np.zeros(len(p))
        for (n, y), theta, c in zip(kinds, parameters.theta(p), parameters.jacobian(p), strict=True):
            e = y - theta @ n
            j = n.T @ c
            s += j.T @ j / np.var(e)
            f += j.T @ e / np.var(e)
        scale = 1 / np.sqrt(np.diag(s))
        step = scale * np.linalg.lstsq(s * np.outer(scale, scale), scale * f, rcond=1e-12)[0]
        size = float(np.max(np.abs(step) / parameters.reach()))
        p = parameters.moved(p, step * min(1.0, _STEP_LIMIT / max(size, 1e-300)))
        if size < _SETTLED:
            break
    return p


def best(model: CompiledModel, run: Run, rate: float, truth: Float, size: Float) -> tuple[Float, Filter]:
    """p of the filter with the least median error against the truth, relative to `size`, and that filter."""

    def tried() -> Iterator[tuple[float, Float, Filter]]:
        for taps, degree in FILTERS:
            smoother = Filter(taps, degree, rate)
            try:
                p = fitted(model, run, smoother, truth)
            except (PvidError, np.linalg.LinAlgError):
                continue
            yield float(np.median(np.abs(p - truth) / size)), p, smoother

    outcomes = list(tried())
    if not outcomes:
        raise PvidError(f"{model.name} has no strong form here")
    _, p, smoother = min(outcomes, key=lambda one: one[0])
    return p, smoother
