"""Twenty-one sets of constraints g = 0 and h >= 0 on rows Y = N^T theta, and their optimum by sequential quadratic
programming."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy as sp
from scipy.optimize import minimize

from pvid.model import Model
from pvid.model.compiled import CompiledModel

Float = npt.NDArray[np.float64]
Symbols = Sequence[sp.Symbol]
Given = Callable[[Symbols], list[sp.Expr]]

SIGMA = 0.3
_TENTH = sp.Rational(1, 10)
_POLE = float(np.exp(-0.1 / 0.2)), float(np.exp(-0.1 / 0.35))


@dataclass(frozen=True)
class Set:
    """Truth, start and constraints of theta; redundant: how many of g follow from those before."""

    truth: tuple[float, ...]
    start: tuple[float, ...]
    g: Given = lambda t: []
    h: Given = lambda t: []
    redundant: int = 0
    positive: bool = False

    @property
    def theta(self) -> list[sp.Symbol]:
        return list(sp.symbols(f"t0:{len(self.truth)}", real=True))

    @property
    def margins(self) -> list[float]:
        """h at the start, at least a little."""
        t = self.theta
        at = dict(zip(t, self.start, strict=True))
        return [max(float(sp.sympify(one).subs(at)), 1e-3) for one in self.h(t)]

    def compiled(self) -> CompiledModel:
        """The unknowns are theta, then the margins of h."""
        model = Model("set")
        y = model.sensor("y", "", noise=SIGMA)
        x = [model.input(f"x{k}", "", "sampled") for k in range(len(self.start))]
        t = [model.unknown(f"t{k}", "", one, positive=self.positive, sd=1.0) for k, one in enumerate(self.start)]
        s = [model.unknown(f"s{k}", "", one, positive=False, sd=1.0, low=0.0) for k, one in enumerate(self.margins)]
        model.equation(y - sum(a * b for a, b in zip(t, x, strict=True)))
        for one in self.g(t):
            model.constraint(one)
        for one, margin in zip(self.h(t), s, strict=True):
            model.constraint(one - margin)
        return model.compiled()

    def rows(self, seed: int, count: int = 400) -> tuple[Float, Float]:
        """N and Y."""
        rng, n = np.random.default_rng(seed), len(self.truth)
        rows = rng.normal(size=(count, n)) @ (np.eye(n) + 0.5 * rng.normal(size=(n, n)))
        return rows, rows @ np.array(self.truth) + SIGMA * rng.normal(size=count)

    def optimum(self, m: Float, b: Float, start: Float) -> Float:
        """The least of t M t / 2 - B t, by SLSQP, which takes no redundant equations; anew from where it ends."""
        t, scale = self.theta, np.trace(m) / len(b)
        g = self.g(t)
        limits = []
        for kind, given in (("eq", g[: len(g) - self.redundant]), ("ineq", self.h(t))):
            if given:
                value = sp.lambdify([t], given)
                slope = sp.lambdify([t], sp.Matrix(given).jacobian(t))
                limits.append({"type": kind, "fun": lambda x, f=value: np.array(f(x)), "jac": lambda x, f=slope: f(x)})
        found = start
        for _ in range(2):
            found = minimize(
                lambda x: (x @ m @ x / 2 - b @ x) / scale, found, jac=lambda x: (m @ x - b) / scale,
                constraints=limits, method="SLSQP", options={"ftol": 1e-16, "maxiter": 1000},
            ).x  # fmt: skip
        return np.asarray(found)


def _minors(t: Symbols) -> list[sp.Expr]:
    return [t[0] * t[4] - t[1] * t[3], t[0] * t[5] - t[2] * t[3], t[1] * t[5] - t[2] * t[4]]


def _sphere(t: Symbols) -> list[sp.Expr]:
    return [t[0] ** 2 + t[1] ** 2 + t[2] ** 2 - 1]


def _product(t: Symbols) -> list[sp.Expr]:
    return [t[2] - t[0] * t[1]]


SETS = {
    "product": Set((2, -1.5, -3), (1, -1, -1), _product),
    "sphere": Set((0.6, 0.48, 0.64), (0.5, 0.1, 0.86), _sphere),
    "circle": Set((0.6, 0.8, 1), (0.8, 0.5, 0.5), lambda t: [t[0] ** 2 + t[1] ** 2 - 1]),
    "rotation": Set(
        (0.8, -0.6, 0.6, 0.8), (0.7, -0.7, 0.7, 0.7), lambda t: [t[0] - t[3], t[1] + t[2], t[0] ** 2 + t[1] ** 2 - 1]
    ),
    "rank one": Set((0.5, 1, 3, -1, -2, -6), (0.56, 0.56, 1.4, -0.8, -0.8, -2), _minors, redundant=1),
    "pole and gain": Set(
        (_POLE[0], 3 - 3 * _POLE[0], 0.2, 3), (_POLE[1], 2 - 2 * _POLE[1], 0.35, 2),
        lambda t: [t[0] - sp.exp(-_TENTH / t[2]), t[1] - t[3] * (1 - t[0])], positive=True,
    ),
    "sum": Set((1, 2, 3), (0.5, 0.5, 5), lambda t: [t[0] + t[1] + t[2] - 6]),
    "ratio": Set((2, 4, 1), (1, 1, 1), lambda t: [t[1] - 2 * t[0]]),
    "twice the same": Set((2, 4, 1), (1, 1, 1), lambda t: [t[1] - 2 * t[0], 3 * t[1] - 6 * t[0]], redundant=1),
    "cubic": Set((1, -2, 0.5), (0.9, -2, 0.5), lambda t: [t[0] ** 3 + t[0] * t[1] + t[1] + 3]),
    "Kepler": Set((1, 1.2 - 0.3 * float(np.sin(1)), 0.3), (0.8, 1, 0.2),
                  lambda t: [t[1] - 12 * _TENTH * t[0] + t[2] * sp.sin(t[0])]),
    "two planes": Set((1, 1, 1, 1), (0.5, 2, 0.5, 0.5), lambda t: [t[0] + t[1] - 2, t[2] - t[3]]),
    "hyperbola": Set((2, 0.5, 1), (1.5, 0.6, 1), lambda t: [t[0] * t[1] - 1]),
    "lemniscate": Set((1.2, 0.4, 0.5), (1, 0.5, 0.5),
                      lambda t: [(t[0] ** 2 + t[1] ** 2) ** 2 - 2 * (t[0] ** 2 - t[1] ** 2)]),
    "friction of 0": Set((1, 0, 0.5), (0.5, 0.4, 0.5), h=lambda t: [t[1]]),
    "triangle of a flat body": Set(
        (1, 2, 3, 0.2), (2, 2, 2, 0.1), h=lambda t: [t[0] + t[1] - t[2], t[0] + t[2] - t[1], t[1] + t[2] - t[0]]
    ),
    "semidefinite, singular": Set((1, 2, 4), (2, 0.5, 2), h=lambda t: [t[0] * t[2] - t[1] ** 2]),
    "cap of a sphere, false": Set((0.6, 0.48, 0.64), (0.5, 0.1, 0.86), _sphere, lambda t: [t[2] - 7 * _TENTH]),
    "product and sum, false": Set((2, -1.5, -3), (1, -1, -1), _product, lambda t: [4 * _TENTH - t[0] - t[1]]),
    "box, corner": Set(
        (1, 1, 1), (0.3, 0.3, 0.3),
        h=lambda t: [8 * _TENTH - t[0], t[0] - _TENTH, 9 * _TENTH - t[1], t[1] - _TENTH],
    ),
    "l2 <= l1": Set((0.3, 0.31, 1), (0.5, 0.2, 0.5), h=lambda t: [t[0] - t[1]]),
}  # fmt: skip
