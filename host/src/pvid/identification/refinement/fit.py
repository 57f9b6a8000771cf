"""Refinement in float64: output error by multiple shooting over the whole run, iterated to convergence.

The run is cut into blocks, each with a start of its own. In every pass all blocks are simulated with the full equations
from their starts at the present r, with exact derivatives; a QR of each block eliminates its start, and what is left of
all blocks, with the prior, gives the step of r. Steps that do not lower the sum of squares are halved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.identification.refinement.kernel import Drive, RefinedKernel
from pvid.oracle.weak.parameters import REDUNDANT, Parameters

Float = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

Inputs = Callable[[float], tuple[Float, Float]]
Stretch = tuple[int, int]  # first sample, last + 1

PASSES = 40
_LARGEST = 0.3  # step of a logarithm in one pass
_HALVINGS = 6
_RETURNS = 3  # Newton steps back to the constraints
_DAMPINGS = (1e-3, 1e-2, 0.1, 1.0, 10.0)  # of a step that leads nowhere
_SETTLED = 0.01  # standard errors: of the last step
_NEARLY = 0.3  # of one from which rounding leads no farther
_RUNS_AWAY = 1e100  # a reading, or its derivative: the square of a larger one overflows
_NO_SQUARE = 1e150  # of residuals over the sensors' noise, and of their derivatives
_MORE = 1.05  # times the samples: what shorter blocks must cover
_GATE = 6.0  # standard deviations of the residuals: a sample beyond is left out
_PARTS = (1, 2, 4, 8, 16, 32, 64)  # of a block, whose scores scatter
_FEWEST_PARTS = 3  # times the unknowns: with fewer, the scatter is not estimated
_LONG_S = 0.016  # residuals are averaged over this for the chi^2 of slow residuals

NOISE = 1.3  # slow chi^2 up to which residuals are taken for noise
_GAINED = 25.0  # fall of the sum of squares over chi^2 that a further parameter needs
GOOD = 3.0  # slow chi^2 up to which a refined answer is preferred to a published one


@dataclass(frozen=True, eq=False)
class Measured:
    """What is fitted.

    Attributes
    ----------
    z : readings [samples, outputs]; NaN where there is none
    sd : of one [outputs]
    inputs : of a skew [s]: inputs and their rates at begin, middle and end of each step, [steps, 3, inputs] each
    rate : of the samples [Hz]
    sub : steps a sample
    coarse : steps that are taken as one where no friction reverses
    grown : variance of a sample over that at low frequencies, sd^2: of samples that went through a filter
    stretches : of the samples, in which the inputs are known; none: all of them
    """

    z: Float
    sd: Float
    inputs: Inputs
    rate: float
    sub: int
    grown: float = 1.0
    coarse: int = 1
    stretches: Sequence[Stretch] = ()

    @property
    def h(self) -> float:
        """Of a step [s]."""
        return 1.0 / self.rate / self.sub


@dataclass(frozen=True, eq=False)
class Prior:
    """Where r is expected: r [parameters], sd of a step from it (inf: nothing is known), and what is searched."""

    r: Float
    sd: Float
    free: Bool


@dataclass(frozen=True, eq=False)
class Cut:
    """A run in blocks of one length: first sample of each [blocks], samples in each."""

    first: npt.NDArray[np.int32]
    samples: int

    @classmethod
    def of(cls, stretches: Sequence[Stretch], samples: int) -> Cut:
        """As many whole blocks of about this length as fill the longest stretch, and as fit into the others. Blocks are
        shorter where that covers more of the others."""
        sizes = np.array([end - first for first, end in stretches])
        longest = int(sizes.max())
        near = max(1, round(longest / samples))

        def covered(length: int) -> int:
            return int((sizes // length).sum()) * length

        length = longest // near
        best = max((longest // count for count in range(near, 3 * near // 2 + 2)), key=covered)
        if covered(best) > _MORE * covered(length):
            length = best
        firsts = [np.arange(size // length) * length + first for (first, _), size in zip(stretches, sizes, strict=True)]
        return cls(np.concatenate(firsts).astype(np.int32), length)

    @property
    def places(self) -> npt.NDArray[np.int64]:
        """Of the samples in the run [blocks, samples]."""
        return self.first[:, None] + np.arange(self.samples)

    def rows(self, values: Float) -> Float:
        """Samples by blocks [blocks, samples, ...]."""
        return np.stack([values[first : first + self.samples] for first in self.first])


@dataclass
class Budget:
    """Work that searches may still do: steps of the integration, each times the columns that are integrated; searches
    share it, and stop where it is spent."""

    left: float = np.inf
    whole: float = np.inf

    @property
    def is_spent(self) -> bool:
        """Whether a search makes no more passes."""
        return self.left <= 0


@dataclass(frozen=True, eq=False)
class Block:
    """Quantities of one pass, for the tests of other implementations.

    Attributes
    ----------
    jacobian : J [blocks, samples, outputs, columns], over sd: by starts, then by steps of r
    error : e [blocks, samples, outputs], over sd; 0 where a sample is left out
    triangle : R of [J e] of each block [blocks, columns + 1, columns + 1]
    """

    jacobian: Float
    error: Float
    triangle: Float


@dataclass(frozen=True, eq=False)
class Refined:
    """Outcome.

    Attributes
    ----------
    r : parameters and settings
    covariance : of the steps of r [parameters, parameters], with the factor of chi^2 and of the scatter of the blocks;
        a variance is 0 where a parameter is not searched, inf where nothing determines it
    noise : the same from the sensors' noise alone
    chi2 : residual variance over that of the sensors
    slow_chi2 : of averages over about 16 ms, which an error of the equations raises first
    converged : the last step was far below the standard errors
    passes : of the search
    cut, starts : blocks and their starts [blocks, states]
    kept : share of the samples that were fitted
    sum_of_squares : of the residuals and the prior
    """

    r: Float
    covariance: Float
    noise: Float
    chi2: float
    slow_chi2: float
    converged: bool
    passes: int
    cut: Cut
    starts: Float
    kept: float
    sum_of_squares: float

    @property
    def significant_fall(self) -> float:
        """Of the sum of squares, to this outcome: what a further parameter needs. By less, another outcome explains the
        run about as well."""
        return _GAINED * max(self.chi2, self.slow_chi2, 1.0)


class Problem:
    """A run under a model."""

    def __init__(self, kernel: RefinedKernel, measured: Measured, budget: Budget | None = None) -> None:
        self.kernel, self.measured, self.budget = kernel, measured, budget or Budget()
        self.n = len(kernel.made.parameters)
        self.log = np.array([one.log for one in kernel.made.parameters])
        self.is_width = np.array([bool(one.sign) for one in kernel.made.parameters])  # of a sign
        self._ties = Parameters(kernel.made.model) if kernel.made.model.constraints else None

    @property
    def stretches(self) -> Sequence[Stretch]:
        """In which the inputs are known."""
        return self.measured.stretches or [(0, len(self.measured.z))]

    @property
    def longest(self) -> int:
        """Samples of the longest stretch."""
        return max(end - first for first, end in self.stretches)

    def cut(self, samples: int) -> Cut:
        """Blocks of about this length."""
        return Cut.of(self.stretches, samples)

    def moved(self, r: Float, step: Float) -> Float:
        """r after a step [parameters], on the constraints as far as Newton steps of least norm lead there."""
        out = self._stepped(r, step)
        for _ in range(0 if self._ties is None else _RETURNS):
            out = self._stepped(out, self._ties_at(out)[0])
        return out

    def _ties_at(self, r: Float, free: npt.NDArray[np.intp] | slice = slice(None)) -> tuple[Float, Float]:
        """The step back to the constraints, and a base of the steps that keep them, of the free entries of r."""
        assert self._ties is not None
        made, p = self.kernel.made, self._ties.guess.copy()
        own = sorted(one.place for one in made.parameters if one.place >= 0)  # what only drifts is no parameter of it
        p[own] = r[made.places_of_p]
        g, of_p = self._ties.constraints(p)
        a = np.zeros((len(g), self.n))
        a[:, made.places_of_p] = of_p[:, own]
        left, sizes, right = np.linalg.svd(a[:, free])
        rank = int(np.sum(sizes > REDUNDANT))
        return -right[:rank].T @ ((left[:, :rank].T @ g) / sizes[:rank]), right[rank:].T

    def _stepped(self, r: Float, step: Float) -> Float:
        out = r.copy()
        head = out[: self.n]
        out[: self.n] = np.where(self.log, head * np.exp(np.where(self.log, step, 0.0)), head + step)
        return out

    def step_between(self, before: Float, after: Float) -> Float:
        """The step from one r to another."""
        a, b = before[: self.n], after[: self.n]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.log, np.log(b / a), b - a)

    def values(self, found: Refined, places: Sequence[int]) -> tuple[Float, Float]:
        """Some parameters [k] and their covariance [k, k], both in their units."""
        chosen = list(places)
        p = found.r[chosen]
        units = np.where(self.log[chosen], p, 1.0)
        return p, found.covariance[np.ix_(chosen, chosen)] * np.outer(units, units)

    def drive(self, r: Float) -> Drive:
        """Inputs as the sensors' skew in r has them."""
        made, m = self.kernel.made, self.measured
        return Drive(m.sub, m.h, *m.inputs(float(r[made.moving - 1]) if made.skew else 0.0), m.coarse)

    def simulated(self, r: Float, cut: Cut, starts: Float) -> Float:
        """Readings [blocks, samples, outputs]."""
        self._spend(cut, 1)
        return self.kernel.blocks(r, cut.first, cut.samples, self.drive(r), starts, False)[0]

    def _spend(self, cut: Cut, columns: int) -> None:
        steps = len(cut.first) * cut.samples * self.measured.sub / self.measured.coarse
        self.budget.left -= steps * columns

    def block(self, r: Float, cut: Cut, starts: Float, use: Bool, move: bool = True) -> Block | None:
        """One pass; None where the motion runs away, or where residuals over a noise have no squares. `move` False: r
        stays, and there are no derivatives by it."""
        m = self.measured
        self._spend(cut, 1 + (self.kernel.columns if move else self.kernel.states))
        z, jacobian, _ = self.kernel.blocks(
            r, cut.first, cut.samples, self.drive(r), starts, True if move else "starts"
        )
        assert jacobian is not None
        jacobian = jacobian if move else np.ascontiguousarray(jacobian[..., : self.kernel.states])
        if not (np.abs(z).max() < _RUNS_AWAY and np.abs(jacobian).max() < _RUNS_AWAY):  # or is no number
            return None
        error = np.where(use, (cut.rows(m.z) - z) / m.sd, 0.0)
        jacobian /= m.sd[:, None]
        jacobian *= use[..., None]
        blocks, columns = len(cut.first), jacobian.shape[-1]
        stacked = np.concatenate([jacobian.reshape(blocks, -1, columns), error.reshape(blocks, -1, 1)], -1)
        triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
        if not np.abs(triangle).max() < _NO_SQUARE:  # LAPACK's search for the singular values of no numbers has no end
            return None
        return Block(jacobian, error, triangle)

    def cost(self, r: Float, cut: Cut, starts: Float, use: Bool, prior: Prior) -> float:
        """Sum of squares of residuals and prior; inf where the motion is no number."""
        if not self.kernel.possible(r):
            return np.inf
        z = self.simulated(r, cut, starts)
        with np.errstate(over="ignore"):  # a motion that runs away
            error = np.where(use, (cut.rows(self.measured.z) - z) / self.measured.sd, 0.0)
            total = float(np.sum(error**2))
        return total + self._prior_cost(r, prior) if np.isfinite(total) else np.inf

    def _prior_cost(self, r: Float, prior: Prior) -> float:
        return float(np.sum((self.step_between(prior.r, r)[prior.free] / prior.sd[prior.free]) ** 2))

    def searched(
        self, r: Float, prior: Prior, cut: Cut, starts: Float, use: Bool, move: bool = True, most: int = PASSES
    ) -> Refined:
        """Gauss-Newton from r and these starts, at most so many passes, and none where the budget is spent; `move`
        False: of the starts alone."""
        free = np.flatnonzero(prior.free) if move else np.zeros(0, int)
        r = self.moved(r, np.zeros(self.n))
        cost = self.cost(r, cut, starts, use, prior)
        converged, passes = False, 0
        found = None  # the block of r and these starts
        while passes < most and not self.budget.is_spent:
            passes += 1
            found = self.block(r, cut, starts, use, move)
            if found is None:
                break
            d_r, d_starts, _, relative = self._step(found.triangle, r, prior, free)
            if relative < _SETTLED:
                converged = True
                break
            share = self._share(d_r)
            for _ in range(_HALVINGS):
                near, begun = self.moved(r, share * d_r), starts + share * d_starts
                now = self.cost(near, cut, begun, use, prior)
                if now < cost:
                    break
                share /= 2
            else:
                damped = self._damped(found.triangle, r, starts, prior, free, cut, use, cost)
                if damped is None or relative < _NEARLY:
                    converged = self._is_near(found.triangle, r, prior, free)  # rounding
                    break
                near, begun, now = damped
            ends = cost - now < 1e-9 * now
            if ends:
                converged = self._is_near(found.triangle, r, prior, free)
            r, starts, cost, found = near, begun, now, None
            if ends:
                break
        searched = prior if move else replace(prior, free=np.zeros(self.n, np.bool_))
        return self._judged(r, searched, cut, starts, use, converged, passes, cost, found)

    def with_starts(self, prior: Prior, cut: Cut, most: int = PASSES) -> Refined:
        """Starts that fit the readings at the r of a prior, which stays."""
        starts = self.first_starts(cut, prior.r)
        return self.searched(prior.r, prior, cut, starts, self.used(cut), move=False, most=most)

    def _is_near(self, triangle: Float, r: Float, prior: Prior, free: npt.NDArray[np.intp]) -> bool:
        """Whether a search that gains no more has arrived: r's step is small with the widths of signs as they are; the
        sum of squares is rough along a width that the run hardly determines."""
        return self._step(triangle, r, prior, free[~self.is_width[free]])[3] < _NEARLY

    def _share(self, d_r: Float) -> float:
        """Of a step that a pass takes at most."""
        return min(1.0, _LARGEST / max(float(np.abs(d_r[self.log]).max(initial=0.0)), 1e-12))

    def _damped(
        self,
        triangle: Float,
        r: Float,
        starts: Float,
        prior: Prior,
        free: npt.NDArray[np.intp],
        cut: Cut,
        use: Bool,
        cost: float,
    ) -> tuple[Float, Float, float] | None:
        """Levenberg's step, which turns towards the steepest descent where the undamped one leads nowhere: r, starts
        and the sum of squares; None where none lowers it."""
        for damping in _DAMPINGS:
            d_r, d_starts, _, _ = self._step(triangle, r, prior, free, damping)
            share = self._share(d_r)
            near, begun = self.moved(r, share * d_r), starts + share * d_starts
            now = self.cost(near, cut, begun, use, prior)
            if now < cost:
                return near, begun, now
        return None

    def _step(
        self, triangle: Float, r: Float, prior: Prior, free: npt.NDArray[np.intp], damping: float = 0.0
    ) -> tuple[Float, Float, Float, float]:
        """Steps of r and of the starts, R of r's free entries, and the size of r's step (or the starts') in standard
        errors. `damping`: of each unknown, on the square of its column."""
        states, n = self.kernel.states, self.n
        top, corner = triangle[:, :states], triangle[:, states:, states:]
        columns = np.append(free, n)
        d_r, whole = np.zeros(n), np.zeros((0, 0))
        relative = 0.0
        if len(free):
            pull = self.step_between(r, prior.r)[free] / prior.sd[free]
            rows = np.concatenate(
                [corner[:, :, columns].reshape(-1, len(columns)), np.column_stack([np.diag(1 / prior.sd[free]), pull])]
            )
            tied = None if self._ties is None else self._ties_at(r, free)
            if tied is not None:
                rows = np.column_stack([rows[:, :-1] @ tied[1], rows[:, -1] - rows[:, :-1] @ tied[0]])
            scale = np.maximum(np.linalg.norm(rows[:, :-1], axis=0), 1e-300)
            own = len(scale)
            if damping > 0:
                rows = np.concatenate([rows, np.column_stack([np.diag(np.sqrt(damping) * scale), 0 * scale])])
            q = np.asarray(np.linalg.qr(rows / np.append(scale, 1.0), mode="r"))
            whole = q[:own, :own] * scale
            moves = np.linalg.lstsq(q[:own, :own], q[:own, -1], rcond=1e-13)[0] / scale
            if tied is not None:
                whole, moves = whole @ tied[1].T, tied[0] + tied[1] @ moves
            d_r[free] = moves
            relative = float(np.linalg.norm(q[:own, -1]))
        right = top[:, :, -1] - (top[:, :, states:-1] @ d_r if len(free) else 0.0)
        left = top[:, :, :states]
        size = np.maximum(np.linalg.norm(left, axis=1), 1e-300)
        scaled = left / size[:, None, :]
        normal = np.swapaxes(scaled, 1, 2) @ scaled + max(damping, 1e-14) * np.eye(states)
        d_starts = np.linalg.solve(normal, (np.swapaxes(scaled, 1, 2) @ right[..., None]))[..., 0] / size
        if not len(free):
            relative = float(np.sqrt(np.mean(right**2)))
        return d_r, d_starts, whole, relative

    def step(self, block: Block, r: Float, prior: Prior) -> tuple[Float, Float, Float]:
        """Gauss-Newton's step of r [parameters] and of the starts [blocks, states], and the information on r's free
        entries with the prior."""
        d_r, d_starts, triangle, _ = self._step(block.triangle, r, prior, np.flatnonzero(prior.free))
        return d_r, d_starts, triangle.T @ triangle

    def _judged(
        self,
        r: Float,
        prior: Prior,
        cut: Cut,
        starts: Float,
        use: Bool,
        converged: bool,
        passes: int,
        cost: float,
        found: Block | None,
    ) -> Refined:
        """`found`: the block of r and these starts where it is known."""
        n, states = self.n, self.kernel.states
        empty = np.full((n, n), np.nan)
        if not np.isfinite(cost):
            found = None
        elif found is None:
            found = self.block(r, cut, starts, use, bool(prior.free.any()))
        if found is None:
            return Refined(r, empty, empty, np.inf, np.inf, False, passes, cut, starts, 0.0, np.inf)
        free = np.flatnonzero(prior.free)
        _, _, triangle, _ = self._step(found.triangle, r, prior, free)
        count = int(use.sum())
        freedom = max(count - len(cut.first) * states - len(free), 1)
        chi2 = float(np.sum(found.error**2)) / freedom / self.measured.grown
        slow = self._slow_chi2(found.error, use, len(cut.first) * states + len(free))
        inverse = np.linalg.pinv(triangle, rcond=1e-14)
        least = inverse @ inverse.T
        wide = max(1.0, chi2, slow) * least
        scatter, own = self._scatter(found, free, least), np.diag(wide)
        # pinv leaves no variance where the run and the prior determine nothing beside the others
        known = (own > 0) & np.isfinite(own) & np.isfinite(scatter)
        grown = np.sqrt(np.maximum(scatter[known] / own[known], 1.0))
        covariance, noise = np.zeros((n, n)), np.zeros((n, n))
        determined = np.ix_(free[known], free[known])
        covariance[determined] = wide[np.ix_(known, known)] * np.outer(grown, grown)
        noise[determined] = least[np.ix_(known, known)]
        unknown = free[~known]
        covariance[unknown, unknown] = noise[unknown, unknown] = np.inf
        kept = count / max(np.isfinite(cut.rows(self.measured.z)).sum(), 1)
        return Refined(r, covariance, noise, chi2, slow, converged, passes, cut, starts, float(kept), cost)

    def _scatter(self, found: Block, free: npt.NDArray[np.intp], information: Float) -> Float:
        """Variances of the free steps from the scatter of the scores of parts of the run, the largest of several
        lengths of a part: residuals that are alike for longer than a sample count as fewer."""
        blocks, states = len(found.error), self.kernel.states
        error = found.error.reshape(blocks, -1, 1)
        jacobian = found.jacobian.reshape(blocks, error.shape[1], -1)
        q = np.linalg.qr(jacobian[:, :, :states])[0]
        across = np.swapaxes(q, 1, 2)
        rest = jacobian[:, :, states + free]
        scores = (rest - q @ (across @ rest)) * (error - q @ (across @ error))  # their starts are eliminated
        out = np.zeros(len(free))
        for parts in _PARTS:
            many, length = blocks * parts, error.shape[1] // parts
            if length == 0 or many <= _FEWEST_PARTS * len(free):
                continue
            sums = scores[:, : length * parts].reshape(many, length, len(free)).sum(1)
            with np.errstate(over="ignore", invalid="ignore"):  # of what nothing determines
                clustered = information @ (sums.T @ sums) @ information * many / (many - len(free))
                out = np.maximum(out, np.diag(clustered))
        return out

    def _slow_chi2(self, error: Float, use: Bool, parameters: int) -> float:
        """Of averages of residuals, each with the variance that white noise of as many samples has."""
        bins = max(1, round(_LONG_S * self.measured.rate))
        whole = error.shape[1] // bins * bins
        if whole == 0:
            return 1.0
        shape = (len(error), whole // bins, bins, error.shape[2])
        sums = np.asarray(error[:, :whole].reshape(shape).sum(2))
        counts = np.asarray(use[:, :whole].reshape(shape).sum(2))
        there = counts > 0
        many = int(there.sum())
        total = float(np.sum(sums[there] ** 2 / counts[there]))
        return total / max(many - parameters, 1)

    def gain(self, found: Refined, prior: Prior, more: npt.NDArray[np.intp]) -> tuple[float, Float]:
        """What the search would gain with these parameters free as well, to first order: the fall of the sum of
        squares, and the factor on each standard error of those that are free."""
        block = self.block(found.r, found.cut, found.starts, self.used(found.cut))
        free = np.flatnonzero(prior.free)
        if block is None:
            return 0.0, np.full(len(free), np.inf)
        both = np.concatenate([free, more])
        errors = []
        falls = []
        for columns in (free, both):
            _, _, triangle, relative = self._step(block.triangle, found.r, prior, columns)
            inverse = np.linalg.pinv(triangle, rcond=1e-14)
            errors.append(np.sqrt((inverse**2).sum(1))[: len(free)])
            falls.append(relative**2)
        return falls[1] - falls[0], errors[1] / np.maximum(errors[0], 1e-300)

    def first_starts(self, cut: Cut, r: Float) -> Float:
        """Starts: measured coordinates and their rates from the samples about each block's first; the rest are
        0."""
        made, m = self.kernel.made, self.measured
        starts = np.zeros((len(cut.first), self.kernel.states))
        names = list(made.coordinates)
        for column, output in enumerate(made.outputs):
            if output in names:
                place = names.index(output)
                value, slope = self._local(cut, m.z[:, column])
                starts[:, place] = value
                if made.order == 2:
                    starts[:, len(names) + place] = slope
                elif f"{output}_1" in names:
                    starts[:, names.index(f"{output}_1")] = slope
        return starts

    def _local(self, cut: Cut, z: Float) -> tuple[Float, Float]:
        """Value and rate at each first sample, of a parabola through the samples about it."""
        half = max(3, min(10, cut.samples // 4))
        values, slopes = [], []
        for first in cut.first:
            low = max(0, min(int(first) - half, len(z) - 2 * half - 1))
            part = z[low : low + 2 * half + 1]
            t = (np.arange(low, low + len(part)) - int(first)) / self.measured.rate
            there = np.isfinite(part)
            if there.sum() < 4:
                values.append(0.0)
                slopes.append(0.0)
                continue
            c = np.polynomial.polynomial.polyfit(t[there], part[there], 2)
            values.append(float(c[0]))
            slopes.append(float(c[1]))
        return np.array(values), np.array(slopes)

    def used(self, cut: Cut) -> Bool:
        """Samples that are there [blocks, samples, outputs]."""
        return np.isfinite(cut.rows(self.measured.z))

    def starts_along(self, r: Float, before: Refined, cut: Cut) -> Float:
        """Starts of other blocks, from the motion of those that are solved."""
        old, drive = before.cut, self.drive(r)
        out = np.empty((len(cut.first), self.kernel.states))
        begins = [first for first, _ in self.stretches]

        def stretch(sample: int) -> int:
            return int(np.searchsorted(begins, sample, side="right"))

        for k, first in enumerate(cut.first):
            b = int(np.clip(np.searchsorted(old.first, first, side="right") - 1, 0, len(old.first) - 1))
            after = int(first - old.first[b])
            if after == 0:
                out[k] = before.starts[b]
            elif after < 0 or stretch(int(first)) != stretch(int(old.first[b])):  # none of them is before it
                out[k] = self.first_starts(Cut(cut.first[k : k + 1], cut.samples), r)[0]
            else:
                begun = before.starts[b : b + 1]
                out[k] = self.kernel.blocks(r, old.first[b : b + 1], after, drive, begun, False)[2][0]
        return out


def gated(problem: Problem, found: Refined) -> Bool:
    """Samples whose residual is not beyond the gate."""
    z = problem.simulated(found.r, found.cut, found.starts)
    error = (found.cut.rows(problem.measured.z) - z) / problem.measured.sd
    spread = 1.4826 * np.nanmedian(np.abs(error), axis=(0, 1))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(error) <= _GATE * np.maximum(spread, 1.0))


def refined(
    problem: Problem,
    prior: Prior,
    lengths: Sequence[int],
    r: Float | None = None,
    before: Refined | None = None,
    most: int = PASSES,
) -> Refined:
    """Blocks of each length [samples] in turn, each from the outcome of the one before.

    Raises PvidError when the run, or its longest stretch, is shorter than a block.

    Parameters
    ----------
    r : to start from; that of the prior, or of `before`, by default
    before : an outcome whose motion gives the first starts
    most : passes for each length
    """
    if problem.longest < lengths[0]:
        of = "the longest stretch without a gap" if problem.measured.stretches else "the run"
        raise PvidError(f"{of} has {problem.longest} samples and a block of the refinement {lengths[0]}")
    found = before
    if r is None:
        r = prior.r.copy() if found is None else found.r
    for samples in lengths:
        cut = problem.cut(samples)
        use = problem.used(cut)
        if found is None:
            starts = problem.first_starts(cut, r)
            starts = problem.searched(r, prior, cut, starts, use, move=False).starts
        else:
            starts = problem.starts_along(r, found, cut)
        found = problem.searched(r, prior, cut, starts, use, most=most)
        r = found.r
    assert found is not None
    return found


def without_outliers(problem: Problem, prior: Prior, found: Refined) -> Refined:
    """The same without the samples beyond the gate."""
    use = gated(problem, found) & problem.used(found.cut)
    if not np.isfinite(found.chi2) or use.all():
        return found
    again = problem.searched(found.r, prior, found.cut, found.starts, use)
    return replace(again, passes=found.passes + again.passes)


def softened(problem: Problem, prior: Prior, found: Refined, use: Bool) -> tuple[Refined, Prior]:
    """With the widths of the signs free, where that explains enough, and the prior of the outcome."""
    r, free = prior.r.copy(), prior.free.copy()
    widths = problem.kernel.widths
    r[widths], free[widths] = found.r[widths], True
    soft = Prior(r, prior.sd, free)
    again = problem.searched(found.r, soft, found.cut, found.starts, use)
    return (again, soft) if found.sum_of_squares - again.sum_of_squares > again.significant_fall else (found, prior)


def explaining(tried: Sequence[Refined], best: Refined) -> tuple[Refined, ...]:
    """Those that explain the run about as well as the best."""
    return tuple(one for one in tried if one.sum_of_squares < best.sum_of_squares + best.significant_fall)
