"""The strong form of any described mechanism in float64: a differentiator bank, a row at every tick, either law.

The derivatives of the signals come from a least-squares polynomial (Savitzky-Golay); their noise is in the regressors,
and no averaging takes the bias of that away. The weak form (oracle.weak) has none; this is the paper's form of the
same equations, for comparison and for signals with little noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel
from pvid.model.evaluation import numpy_function
from pvid.model.signals import Integral, Jet, jets, sgn
from pvid.model.strong import strong_form
from pvid.oracle.weak.channels import broadcast, running_integrals
from pvid.oracle.weak.errors import clustered_variance
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import filtered, of_hold, samples_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import Parameters
from pvid.oracle.weak.solve import inverse, least_squares_step, solved

_STEP_LIMIT = 0.3  # of log p, or of p over its reach
_REWEIGHTINGS = 30
_SETTLED = 1e-8


@dataclass(frozen=True)
class StrongSettings:
    """Settings of the strong form.

    Attributes
    ----------
    taps, degree : of the polynomial; the degree at least that of the highest derivative
    every : samples from row to row
    law : "stationary": a Gauss-Newton step on all rows so far at every tick; "pseudovelocity": the paper's law alone,
        dp = S^-1 C^T N (Y - N^T theta)
    forgetting_s : time constant [s]; 0: none
    """

    taps: int = 61
    degree: int = 6
    every: int = 8
    law: Literal["stationary", "pseudovelocity"] = "stationary"
    forgetting_s: float = 0.0


@dataclass(frozen=True)
class StrongRows:
    """Rows of a run at every tick.

    Attributes
    ----------
    regressors : of each kind [ticks, thetas]
    known : of each kind [ticks]
    times : of the ticks [s]
    """

    regressors: list[Float]
    known: list[Float]
    times: Float


@dataclass(frozen=True)
class StrongIdentified:
    """What the strong form gives.

    Attributes
    ----------
    names : of the parameters
    p, se : by all rows at once; from the scatter of blocks of rows that share samples [n_p]
    times, history : [ticks, s]; p after each tick by the law [ticks, n_p]
    r2 : of each row kind
    """

    names: tuple[str, ...]
    p: Float
    se: Float
    times: Float
    history: Float
    r2: dict[str, float]


class StrongModel:
    """The strong form of a model with its functions of the signals."""

    def __init__(self, compiled: CompiledModel) -> None:
        self.model = strong_form(compiled)
        self.parameters = Parameters(self.model)
        rows = [
            [self.model.with_knowns(sp.sympify(part.get(0, 0))) for part in (*row.regressors, row.known)]
            for row in self.model.rows
        ]
        used: set[Jet] = set().union(*(jets(one) for row in rows for one in row))
        names = {jet.of for jet in used}
        self.opaque = {
            jet: self.model.with_knowns(value) for jet, value in self.model.opaque.items() if jet.of in names
        }
        auxiliary = {jet.of for jet in self.opaque}
        inner: set[Jet] = set().union(*(jets(one) for one in self.opaque.values()))
        self.needed = sorted({jet for jet in used | inner if jet.of not in auxiliary}, key=str)
        self.auxiliary = sorted({jet for jet in used if jet.of in auxiliary}, key=str)
        self._rows = [self._function(row) for row in rows]

    @property
    def order(self) -> int:
        """Highest derivative of a signal."""
        return max((jet.order for jet in (*self.needed, *self.auxiliary)), default=0)

    def _function(self, expressions: list[sp.Expr]) -> Any:
        return sp.lambdify(
            [*self.needed, *self.auxiliary], expressions, modules=[{sgn.__name__: np.sign}, "numpy"], cse=True
        )

    def rows(self, run: Mapping[str, npt.ArrayLike], sample_rate: float, settings: StrongSettings) -> StrongRows:
        """Of a run: name -> samples [n]."""
        taps, half = settings.taps, settings.taps // 2
        if taps % 2 == 0 or taps <= settings.degree or settings.degree < self.order:
            raise PvidError(
                f"the strong form of {self.model.name} needs derivatives up to order {self.order}: a polynomial of at "
                f"least that degree and an odd number of taps above it, not degree {settings.degree} and {taps} taps"
            )
        samples = samples_of(self.model, run)
        held = {one.name for one in self.model.signals if one.hold == "zoh"}
        raw = {name: of_hold(x) if name in held else x for name, x in samples.items()}
        size = next(iter(raw.values())).size

        def derivative(x: Float, order: int) -> Float:
            return filtered(x, polynomial_weights(taps, settings.degree, order) * sample_rate**order)

        values = {jet: derivative(raw[jet.of], jet.order) for jet in self.needed}
        margin = 2 * half if self.auxiliary else half
        for jet, expression in self.opaque.items():
            whole = self._opaque(expression, values, raw, size, 1 / sample_rate)
            values |= {one: derivative(whole, one.order) for one in self.auxiliary if one.of == jet.of}
        places = np.arange(margin, size - margin, settings.every)
        if len(places) < 4 * len(self.parameters.guess):
            raise PvidError(f"{size} samples are too few for derivatives over {taps} of them")
        arguments = [values[jet][places] for jet in (*self.needed, *self.auxiliary)]
        columns = [np.array([broadcast(one, len(places)) for one in row(*arguments)]).T for row in self._rows]
        return StrongRows([one[:, :-1] for one in columns], [one[:, -1] for one in columns], places / sample_rate)

    def _opaque(
        self, expression: sp.Expr, values: Mapping[Jet, Float], raw: Mapping[str, Float], size: int, dt: float
    ) -> Float:
        """An auxiliary signal at every sample."""
        known: dict[sp.Symbol, Float] = dict(values)
        for one in sorted(expression.atoms(Integral), key=sp.default_sort_key):
            integrand, fold = one.args
            mark = sp.Dummy()
            symbols = sorted(jets(integrand), key=str)
            inner = numpy_function(symbols, integrand)(
                *[raw[jet.of] if jet.order == 0 else values[jet] for jet in symbols]
            )
            known[mark] = running_integrals(broadcast(inner, size), size - 1, int(fold), dt)[int(fold)][0]
            expression = expression.xreplace({one: mark})
        symbols = sorted(expression.free_symbols, key=str)
        function = sp.lambdify(symbols, expression, modules=[{sgn.__name__: np.sign}, "numpy"])
        return np.array(broadcast(function(*[known[one] for one in symbols]), size))


def identify_strong(
    compiled: CompiledModel,
    run: Mapping[str, npt.ArrayLike],
    sample_rate: float,
    start: npt.ArrayLike | None = None,
    settings: StrongSettings | None = None,
) -> StrongIdentified:
    """Parameters by the strong form; the weight of a row kind is the inverse of its residuals' variance."""
    used = settings or StrongSettings()
    model = StrongModel(compiled)
    begun = model.parameters.checked(None if start is None else np.asarray(start, np.float64))
    rows = model.rows(run, sample_rate, used)
    p, weights = all_rows(model.parameters, rows, begun)
    block = max(1, -(-used.taps // used.every))
    return StrongIdentified(
        compiled.p_names,
        p,
        standard_errors(model.parameters, rows, p, weights, block),
        rows.times,
        by_ticks(model.parameters, rows, begun, weights, sample_rate / used.every, used),
        {
            row.name: 1 - float(np.sum(e**2) / max(np.sum((y if y.any() else n[:, 0] * th[0]) ** 2), 1e-300))
            for row, e, n, y, th in zip(
                model.model.rows,
                residuals(model.parameters, rows, p),
                rows.regressors,
                rows.known,
                model.parameters.theta(p),
                strict=True,
            )
        },
    )


def residuals(parameters: Parameters, rows: StrongRows, p: Float) -> list[Float]:
    """Of each kind [ticks]."""
    return [y - n @ th for n, y, th in zip(rows.regressors, rows.known, parameters.theta(p), strict=True)]


def all_rows(parameters: Parameters, rows: StrongRows, start: Float) -> tuple[Float, Float]:
    """p by Gauss-Newton on all rows, and the weight of each kind, both until they stay."""
    p = start
    prior = np.diag(parameters.prior(start))
    reach = parameters.reach()
    m = [n.T @ n for n in rows.regressors]
    b = [n.T @ y for n, y in zip(rows.regressors, rows.known, strict=True)]
    weights = np.ones(len(m))
    for _ in range(_REWEIGHTINGS):
        weights = np.array([1 / max(float(np.var(e)), 1e-300) for e in residuals(parameters, rows, p)])
        s, f = prior.copy(), np.zeros(len(p))
        for w, mm, bb, th, c in zip(weights, m, b, parameters.theta(p), parameters.jacobian(p), strict=True):
            s += w * c.T @ mm @ c
            f += w * c.T @ (bb - mm @ th)
        step = least_squares_step(parameters, p, s, f)
        size = float(np.max(np.abs(step) / reach))
        p = parameters.moved(p, step * min(1.0, _STEP_LIMIT / max(size, 1e-300)))
        if size < _SETTLED:
            break
    return p, weights


def by_ticks(
    parameters: Parameters, rows: StrongRows, start: Float, weights: Float, rate: float, settings: StrongSettings
) -> Float:
    """p after each tick [ticks, n_p] by the law: M, B take the rows in, S = C^T M C + H0, a limited step."""
    p = start
    prior = np.diag(parameters.prior(start))
    reach = parameters.reach()
    keep = math.exp(-1 / (settings.forgetting_s * rate)) if settings.forgetting_s > 0 else 1.0
    sizes = [n.shape[1] for n in rows.regressors]
    m, b = [np.zeros((n, n)) for n in sizes], [np.zeros(n) for n in sizes]
    history = np.empty((len(rows.times), len(p)))
    for tick in range(len(rows.times)):
        s, f = prior.copy(), np.zeros(len(p))
        theta, jacobian = parameters.theta(p), parameters.jacobian(p)
        for kind, w in enumerate(weights):
            n, y, c = rows.regressors[kind][tick], rows.known[kind][tick], jacobian[kind]
            m[kind] = keep * m[kind] + w * np.outer(n, n)
            b[kind] = keep * b[kind] + w * n * y
            s += c.T @ m[kind] @ c
            if settings.law == "stationary":
                f += c.T @ (b[kind] - m[kind] @ theta[kind])
            else:
                f += w * c.T @ n * (y - n @ theta[kind])
        stays = settings.law == "stationary"
        step = least_squares_step(parameters, p, s, f) if stays else solved(s, f, parameters.tangent(p))
        size = float(np.max(np.abs(step) / reach))
        p = parameters.moved(p, step * min(1.0, _STEP_LIMIT / max(size, 1e-300)))
        history[tick] = p
    return history


def standard_errors(parameters: Parameters, rows: StrongRows, p: Float, weights: Float, block: int) -> Float:
    """From the scatter of blocks of rows that share samples, neighbours counted [n_p]."""
    whole = len(rows.times) // block * block
    scores = np.zeros((len(rows.times), len(p)))
    information = np.diag(parameters.prior(p))
    for w, n, e, c in zip(
        weights, rows.regressors, residuals(parameters, rows, p), parameters.jacobian(p), strict=True
    ):
        own = n @ c
        information = information + w * own.T @ own
        scores += w * own * e[:, np.newaxis]
    blocks = scores[:whole].reshape(-1, block, len(p)).sum(axis=1)
    s_inverse = inverse(information, parameters.tangent(p))
    return np.asarray(parameters.unit(p) * np.sqrt(clustered_variance(blocks, s_inverse)))
