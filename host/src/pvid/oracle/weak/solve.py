"""Estimates of p from the rows of a run: all windows at once, and window by window."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, wraps

import numpy as np
import numpy.typing as npt

from pvid.oracle.weak import work
from pvid.oracle.weak.failures import FAILURES
from pvid.oracle.weak.functions import Float, TestFunctions
from pvid.oracle.weak.parameters import REDUNDANT, Parameters
from pvid.oracle.weak.rows import EquationError, Unexplained, WeakRows, WhiteRows

RIDGE = 1e-13  # added to the unit diagonal of what is inverted
_STEP_LIMIT = 0.3  # largest step of log p, or of p over its reach
PASSES = 25  # of whitening at the present p
_LEAST_PASSES = 4  # of them where the work is spent
_STEPS = 30  # of Gauss-Newton between two whitenings
_PIVOTS = 256  # of the bounds that act in a step
_CURVED = 0.2  # of S: least curvature with that of the constraints
SETTLED = 1e-8  # a step below this ends the search
COMPARED, PASSES_COMPARED = 1e-5, 10  # enough to compare estimates: far below what they differ by
_STILL = 1e-5  # standard errors: a smaller step of Gauss and Newton is along what the rows do not determine

# An error of the equation is taken for real if it raises twice the logarithm of the likelihood by this much.
_EVIDENCE = 10.0
_HINT = 2.0  # with the mean of the windows' weights, below which the exact likelihood is not computed

_SEARCHES = (2, 6)  # passes that look for an error of the equation; the others improve its variance
_SHARPENING = 3  # steps of a variance at a time

_PASSES_ANEW = 12  # of whitening at most, window by window
_STAYS = 1e-3  # a step below this ends them


@dataclass(frozen=True)
class Moments:
    """Normal equations of all groups of row kinds: M and B of each."""

    kinds: list[tuple[int, ...]]
    m: list[Float]
    b: list[Float]

    @classmethod
    def of(cls, white: list[WhiteRows]) -> Moments:
        """Of whitened rows."""
        pairs = [one.moments() for one in white]
        return cls([one.kinds for one in white], [m for m, _ in pairs], [b for _, b in pairs])

    def plus(self, other: Moments) -> Moments:
        """Of the windows of both."""
        return Moments(
            self.kinds,
            [a + b for a, b in zip(self.m, other.m, strict=True)],
            [a + b for a, b in zip(self.b, other.b, strict=True)],
        )

    def grouped(self, of_kinds: Sequence[Float]) -> list[Float]:
        """What each kind has, by group."""
        return [np.concatenate([of_kinds[kind] for kind in group]) for group in self.kinds]


def normal(parameters: Parameters, moments: Moments, p: Float, theta: list[Float]) -> tuple[Float, Float]:
    """S [n_p, n_p] and F [n_p] at p and its thetas of each group, in units of a step."""
    jacobian = moments.grouped(parameters.jacobian(p))
    n = len(p)
    s, f = np.zeros((n, n)), np.zeros(n)
    for m, b, th, c in zip(moments.m, moments.b, theta, jacobian, strict=True):
        s += c.T @ m @ c
        f += c.T @ (b - m @ th)
    return s, f


def misfit(moments: Moments, theta: list[Float]) -> float:
    """Sum of squared residuals at the thetas of each group, but for a constant."""
    total = 0.0
    for m, b, th in zip(moments.m, moments.b, theta, strict=True):
        total += float(th @ m @ th - 2 * th @ b)
    return total


def solved(s: Float, f: Float, tangent: Float | None = None) -> Float:
    """S^-1 f with S scaled to a unit diagonal; T (T^T S T)^-1 T^T f with constraints, whose tangent is T."""
    if tangent is not None:
        return np.asarray(tangent @ solved(tangent.T @ s @ tangent, tangent.T @ f))
    scale = 1 / np.sqrt(np.maximum(s.diagonal(), 1e-300))
    return np.asarray(scale * np.linalg.solve(s * (scale[:, np.newaxis] * scale) + _ridge(len(s)), scale * f))


@cache
def _ridge(n: int) -> Float:
    return RIDGE * np.eye(n)


def inverse(s: Float, tangent: Float | None = None) -> Float:
    """S^-1, S scaled to a unit diagonal; T (T^T S T)^-1 T^T with constraints, whose tangent is T."""
    if tangent is not None:
        return np.asarray(tangent @ inverse(tangent.T @ s @ tangent) @ tangent.T)
    scale = 1 / np.sqrt(np.maximum(np.diag(s), 1e-300))
    scaled = s * np.outer(scale, scale) + _ridge(len(s))
    return np.asarray(np.linalg.inv(scaled) * np.outer(scale, scale))


def gauss_newton(parameters: Parameters, moments: Moments, p: Float, prior: Float, steps: int) -> tuple[Float, float]:
    """p after up to `steps` limited steps, and the size of the first one."""
    reach, weak = parameters.reach(), np.diag(prior)
    first = 0.0
    theta = moments.grouped(parameters.theta(p))
    after = misfit(moments, theta)
    for k in range(steps):
        work.spend_step()
        s, f = normal(parameters, moments, p, theta)
        step = least_squares_step(parameters, p, s + weak, f)
        size = float(np.max(np.abs(step) / reach))
        step *= min(1.0, _STEP_LIMIT / max(size, 1e-300))
        first = size if k == 0 else first
        before = after
        for _ in range(8):
            moved = parameters.moved(p, step)
            theta = moments.grouped(parameters.theta(moved))
            after = misfit(moments, theta)
            if after <= before + 1e-9 * abs(before):
                break
            step = step / 2
        p = moved
        if size < SETTLED or (k >= 2 and step @ (s + weak) @ step < _STILL**2):
            break
    return p, first


def least_squares_step(parameters: Parameters, p: Float, s: Float, f: Float) -> Float:
    """The least-squares step that keeps bounds and constraints, with the curvature of these where S stays positive."""
    if not parameters.model.constraints:
        return _bounded_step(s, f, parameters.blocked(p, f))
    step, reactions = _tied_step(parameters, p, s, f)
    curved = s + parameters.curvature(p, reactions)
    tangent = parameters.tangent(p)
    assert tangent is not None
    root = tangent @ np.linalg.cholesky(inverse(tangent.T @ s @ tangent))
    if np.linalg.eigvalsh(root.T @ curved @ root)[0] > _CURVED:
        step, _ = _tied_step(parameters, p, curved, f)
    return step


def _tied_step(parameters: Parameters, p: Float, s: Float, f: Float) -> tuple[Float, Float]:
    """The step, and the reactions of the constraints.

    A bound holds its parameter iff its multiplier, the force that is left there, points outwards: Murty's least-index
    pivots, which end for a positive S.
    """
    n = len(p)
    a, (least, most) = parameters.constraints(p)[1], parameters.room(p)
    low, high = np.zeros((2, n), np.bool_)
    step, pull = np.zeros(n), np.zeros(len(a))
    for _ in range(_PIVOTS):
        held = low | high
        rows = np.vstack([a, np.eye(n)[held]])
        wanted = np.concatenate([np.zeros(len(a)), np.where(low, least, most)[held]])
        base = np.linalg.pinv(rows, rcond=REDUNDANT) @ wanted
        step = base + solved(s, f - s @ base, parameters.tangent(p, held))
        pull = np.linalg.lstsq(rows.T, f - s @ step, rcond=REDUNDANT)[0]
        own = np.zeros(n)
        own[held] = pull[len(a) :]
        wrong = np.flatnonzero(np.where(low, own > 0, np.where(high, own < 0, (step < least) | (step > most))))
        if not wrong.size:
            break
        k = wrong[0]
        low[k], high[k] = not held[k] and step[k] < least[k], not held[k] and step[k] > most[k]
    return step, pull[: len(a)]


def _bounded_step(s: Float, f: Float, blocked: npt.NDArray[np.bool_]) -> Float:
    """S^-1 f of what no bound holds; 0 of the others."""
    if not blocked.any():
        return solved(s, f)
    free = np.flatnonzero(~blocked)
    step = np.zeros(len(f))
    if free.size:
        step[free] = solved(s[np.ix_(free, free)], f[free])
    return step


@dataclass(frozen=True)
class Fit:
    """An estimate and what is needed to judge it.

    Attributes
    ----------
    p : [n_p]
    rows, white : the windows; whitened at p, or where its last, tiny step began
    errors : of each row kind
    start : where the search began
    settled : the last step was tiny
    diverged : the search ran away; p is where it last could be computed with
    numbers : of it, that were computed (`of_fit`)
    """

    p: Float
    rows: WeakRows
    white: list[WhiteRows]
    errors: list[EquationError]
    start: Float
    settled: bool
    diverged: bool = False
    numbers: dict[str, float] = field(init=False, default_factory=dict, repr=False, compare=False)

    @property
    def parameters(self) -> Parameters:
        """Of its model."""
        return self.rows.compiled.parameters

    @property
    def tangent(self) -> Float | None:
        """Of its constraints."""
        return self.parameters.tangent(self.p)

    def only(self, windows: slice | npt.NDArray[np.bool_]) -> Fit:
        """The same estimate and weights, with some of the windows."""
        return replace(self, rows=self.rows.only(windows), white=[one.only(windows) for one in self.white])

    def at(self, p: Float) -> Fit:
        """Another estimate from the same weights."""
        return replace(self, p=p)

    def alone(self, kind: int) -> WhiteRows:
        """Rows of one kind, whitened by themselves."""
        own = [one for one in self.white if one.kinds == (kind,)]
        return own[0] if own else self.rows.white((kind,), self.parameters.theta(self.p), self.errors)

    def designs(self) -> list[Float]:
        """d rows / d step of each group [windows, R, n_p]."""
        jacobian = self.parameters.jacobian(self.p)
        return [one.slopes(jacobian) for one in self.white]

    def residuals(self) -> list[Float]:
        """Whitened, of each group [windows, R]."""
        theta = self.parameters.theta(self.p)
        return [one.residuals(theta) for one in self.white]


def of_fit(number: Callable[[Fit], float]) -> Callable[[Fit], float]:
    """A number of a fit that is computed once: a whitening of all rows each."""

    @wraps(number)
    def kept(fit: Fit) -> float:
        if number.__name__ not in fit.numbers:
            fit.numbers[number.__name__] = number(fit)
        return fit.numbers[number.__name__]

    return kept


class DivergedError(ArithmeticError):
    """A search for p ran away, and with it every number that depends on it.

    Attributes
    ----------
    fit : the last that could be computed
    """

    def __init__(self, fit: Fit) -> None:
        super().__init__("the search for the parameters ran away")
        self.fit = fit


def batch(
    rows: WeakRows,
    start: Float | None = None,
    equation_error: bool = True,
    compensate: bool = True,
    passes: int = PASSES,
    settled: float = SETTLED,
) -> Fit:
    """All windows at once: whiten at p, step, and again until p stays.

    Raises DivergedError when p leaves what numbers hold. Raises numpy.linalg.LinAlgError when the rows cannot be
    whitened at the start.

    Parameters
    ----------
    rows : windows of a run
    start : of p; None: the guesses
    equation_error : estimate the error of each equation from its residuals and weight with it
    compensate : take the bias of noise in the regressors off, E[N R^-1 e] = -1/2 d log det R / d theta
    passes : of whitening at the present p, at most
    settled : a first step of a pass below this ends them, in units of a parameter's reach
    """
    last: Fit | None = None
    try:
        for fit in _passes(rows, start, equation_error, compensate, passes, settled):
            last = fit
    except FAILURES as error:
        if last is None:
            raise
        raise DivergedError(replace(last, settled=False, diverged=True)) from error
    assert last is not None
    return last


def _passes(
    rows: WeakRows, start: Float | None, equation_error: bool, compensate: bool, passes: int, enough: float
) -> Iterator[Fit]:
    """The estimate before each pass of `batch`, and after the last."""
    parameters = rows.compiled.parameters
    p = begun = parameters.checked(start)
    prior = parameters.prior(begun)
    errors = before = [EquationError()] * rows.kinds
    settled, size = False, np.inf
    for turn in range(passes):
        if turn >= _LEAST_PASSES and work.is_spent():
            break
        work.spend(rows.work)
        theta = parameters.theta(p)
        white = [rows.white(group, theta, errors) for group in rows.groups]
        yield Fit(p, rows, white, errors, begun, settled=False)
        moments = compensated(rows, white, theta) if compensate else Moments.of(white)
        p, size = gauss_newton(parameters, moments, p, prior, 3 if turn < 4 else _STEPS)
        before, changed = errors, False
        if equation_error and turn >= 2:
            now = parameters.theta(p)
            errors = [improved(rows, kind, now, errors[kind], turn) for kind in range(rows.kinds)]
            changed = any(differs(a, b) for a, b in zip(before, errors, strict=True))
        settled = size < 1e-4
        if size < enough and turn >= (2 if equation_error else 1) and not changed:
            settled = True
            break
    if not np.isfinite(p).all():
        raise FloatingPointError
    if not settled or size >= enough or errors != before:  # else the rows are as white as they become
        theta = parameters.theta(p)
        white = [rows.white(group, theta, errors) for group in rows.groups]
    yield Fit(p, rows, white, errors, begun, settled)


def resumed(rows: WeakRows, fit: Fit, passes: int) -> Fit:
    """The estimate from other rows of the same windows, from where a fit came to rest: the errors of the equations keep
    their orders.

    Raises numpy.linalg.LinAlgError, FloatingPointError when the numbers run away.
    """
    parameters, p, errors = rows.compiled.parameters, fit.p, fit.errors
    prior, size = parameters.prior(fit.start), np.inf
    for turn in range(passes + 1):
        work.spend(rows.work)
        theta, before = parameters.theta(p), errors
        errors = [
            sharpened(rows.unexplained(k, theta), rows.functions, one, 1) if one.variance else one
            for k, one in enumerate(errors)
        ]
        white = [rows.white(group, theta, errors) for group in rows.groups]
        if turn == passes or size < COMPARED and not any(map(differs, before, errors)):
            break
        p, size = gauss_newton(parameters, compensated(rows, white, theta), p, prior, 3)
    if not np.isfinite(p).all():
        raise FloatingPointError
    return Fit(p, rows, white, errors, fit.start, settled=True)


def compensated(rows: WeakRows, white: list[WhiteRows], theta: Sequence[Float]) -> Moments:
    """Moments with what noise in the regressors takes from B put back, of all windows.

    Without it a row with Y = 0 pulls its own scale towards 0 by one for each of its rows, since a smaller theta leaves
    smaller residuals at the weights of the theta before.
    """
    moments = Moments.of(white)
    for place, pull in enumerate(pulls(rows, white, theta)):
        moments.b[place] += pull
    return moments


def pulls(rows: WeakRows, white: list[WhiteRows], theta: Sequence[Float]) -> list[Float]:
    """1/2 d log det R / d theta of each group, of all windows [thetas of its kinds]."""
    k, out = rows.functions.count, []
    for one in white:
        total = one.whitener.total_inverse()
        of_kinds = []
        for a, kind in enumerate(one.kinds):
            blocks = [total[a * k : (a + 1) * k, b * k : (b + 1) * k] for b in range(len(one.kinds))]
            own = [
                rows.noise.pull(kind, other, theta[other], block)
                for other, block in zip(one.kinds, blocks, strict=True)
            ]
            of_kinds.append(np.sum(own, axis=0)[: len(theta[kind])])
        pull = np.concatenate(of_kinds)
        if one.whitener.alike:
            pull = pull + rows.reversals.slopes(one.kinds, *one.whitener.inverse_of_directions())
        out.append(pull)
    return out


def differs(a: EquationError, b: EquationError) -> bool:
    """By more than a part in a thousand."""
    return a.order != b.order or abs(a.variance - b.variance) > 1e-3 * max(a.variance, b.variance)


def improved(rows: WeakRows, kind: int, theta: Sequence[Float], last: EquationError, turn: int) -> EquationError:
    """The equation's error at a pass of the search for p."""
    if turn in _SEARCHES:
        return error_of(rows, kind, theta)
    return sharpened(rows.unexplained(kind, theta), rows.functions, last, 1) if last.variance else last


def error_of(rows: WeakRows, kind: int, theta: Sequence[Float]) -> EquationError:
    """The equation's error of most likelihood: white noise of order 0.. in the row, beside that of the sensors.

    With R0 = L L^T, L^-1 Q L^-T = U diag(q) U^T and z = U^T L^-1 e the likelihood of the variance v is that of
    independent z_i of variances 1 + v q_i. That is where a variance starts; orders are compared with the weights of
    each window, reversals and all.
    """
    under = rows.unexplained(kind, theta)
    plain = under(EquationError())
    e = plain.residuals
    best, gain = EquationError(), _EVIDENCE
    # What the projection on the complement of the nuisances took out of the residuals.
    share = plain.free / e.size
    moment = e.T @ e / (len(e) * share)
    whitener = plain.whitener.base
    without = plain.unlikelihood
    for order in range(rows.compiled.channels.rows_top(kind) + 1):
        white = whitener @ rows.functions.gram(order, order) @ whitener.T
        if not np.isfinite(white).all():  # sensors of no size that a number holds
            continue
        q, u = np.linalg.eigh(white)
        q = np.maximum(q, 0.0)
        z = np.asarray(np.sum(u * (moment @ u), axis=0))
        v, rise = most_likely(q, z)
        if rise * len(e) * share < _HINT:
            continue
        found = sharpened(under, rows.functions, EquationError(v, order))
        # Neighbours share half of their samples: rows count half.
        rise = (without - under(found).unlikelihood) / 2
        if rise > gain:
            best, gain = found, rise
    return best


def sharpened(
    under: Callable[[EquationError], Unexplained],
    functions: TestFunctions,
    error: EquationError,
    steps: int = _SHARPENING,
) -> EquationError:
    """The variance with the weights of each window in place of their mean.

    Where the likelihood is at its maximum, sum e^T R^-1 Q R^-1 e = sum tr(R^-1 Q): v is scaled by their ratio.

    Parameters
    ----------
    under : what is left of the kind, by the error of its equation
    """
    q = functions.gram(error.order, error.order)
    for _ in range(steps):
        left = under(error)
        e = left.residuals
        ratio = left.whitener.energy(q, e) / (left.whitener.trace(q) * left.free / e.size)
        error = EquationError(error.variance * ratio, error.order)
        if abs(ratio - 1) < 1e-3:
            break
    return error


def most_likely(q: Float, z: Float) -> tuple[float, float]:
    """v >= 0 that makes sum log(1 + v q) + z/(1 + v q) least, and by how much less it is than at 0."""
    top = float(np.max(q))
    if top <= 0:
        return 0.0, 0.0
    grid = np.concatenate([[0.0], np.logspace(-3, 1, 25) * max(float(np.mean(z)), 1.0) / top])
    floor = float(np.min(q[q > 1e-9 * top]))
    grid = np.concatenate(
        [grid, np.logspace(np.log10(grid[-1]), np.log10(10 * max(float(np.max(z)), 1.0) / floor), 60)]
    )

    def cost(v: Float) -> Float:
        spread = 1 + v[:, np.newaxis] * q
        return np.asarray(np.sum(np.log(spread) + z / spread, axis=1))

    for _ in range(3):
        values = cost(grid)
        k = int(np.argmin(values))
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        grid = np.concatenate([[0.0, grid[k]], np.linspace(low, high, 30)])
    values = cost(grid)
    k = int(np.argmin(values))
    return float(grid[k]), float(values[0] - values[k])


def online(rows: WeakRows, start: Float | None = None, equation_error: bool = True) -> Float:
    """p after each window [windows, n_p]: every window whitened at the p of its moment, three steps each.

    The sums of rows that were whitened at a poor p weigh wrongly. Here all rows are whitened anew when their number is
    a power of two, and again until p stays: three steps from a start that is 50 % off are too few. A core that keeps
    no rows lets its first sums fade instead. NaN from the window on at which numbers run away.
    """
    history = np.full((rows.windows, len(rows.compiled.parameters.names)), np.nan)
    with suppress(*FAILURES):
        for w, p in enumerate(_growing(rows, start, equation_error)):
            history[w] = p
    return history


def _growing(rows: WeakRows, start: Float | None, equation_error: bool) -> Iterator[Float]:
    """p after each window."""
    parameters = rows.compiled.parameters
    p = parameters.checked(start)
    prior = parameters.prior(p)
    errors = [EquationError()] * rows.kinds
    moments = Moments([], [], [])
    for w in range(rows.windows):
        anew = w & (w + 1) == 0
        if anew and equation_error and w >= 3:
            past = rows.only(slice(0, w))
            theta = parameters.theta(p)
            errors = [error_of(past, kind, theta) for kind in range(rows.kinds)]
        own = rows.only(slice(0 if anew else w, w + 1))
        for _ in range(_PASSES_ANEW if anew else 1):
            theta = parameters.theta(p)
            new = compensated(own, [own.white(group, theta, errors) for group in rows.groups], theta)
            whole = new if anew else moments.plus(new)
            p, size = gauss_newton(parameters, whole, p, prior, 3)
            if size < _STAYS:
                break
        moments = whole
        yield p
