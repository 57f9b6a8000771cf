"""Twin of weak/weak_finish_f32.c: from the sums of a whole window to rows, steps of p, the published estimate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.weak import WeakConfig
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.trust import Trust
from pvid.twin.f32.weak_columns import parts_of_columns, projected
from pvid.twin.f32.weak_error import OwnError
from pvid.twin.f32.weak_noise import Noise
from pvid.twin.f32.weak_scores import Scores
from pvid.twin.f32.weak_white import Rows, White, total
from pvid.twin.record import Mask, Reasons, of_all_lanes
from pvid.twin.trust import Candidate

Float32 = npt.NDArray[np.float32]
Stages = Iterator[Reasons | None]

_F = np.float32
_ENTRIES_PER_STAGE, _PRODUCTS_PER_STAGE, _SHARES_PER_STAGE = 7, 30, 4
_BOTH_FAMILIES = 16
_GATE_MEMORY = _F(4)
_VARIANCE_MAX = _F(1e36)


def _parts(whole: int, each: int) -> int:
    return max(1, -(-whole // each))


class Finish:
    """What processes the windows of an identifier, in several lanes.

    Attributes
    ----------
    alone : the next window has no neighbour before it
    candidate : the estimate of the last window [lanes], published or not
    """

    def __init__(self, config: WeakConfig, dt: np.float32, estimator: RelativeEstimator, trust: Trust) -> None:
        design = self.design = config.design
        self.estimator, self.trust = estimator, trust
        self.rows = Rows(design, dt)
        self.compensation = config.compensation
        self.iterations = 1 if estimator.is_rate else config.iterations
        windows_hz = _F(1) / (dt * _F(design.hop))
        lanes = estimator.p.shape[1]
        self.gates = [
            Gate(config.gate, windows_hz, _GATE_MEMORY, np.ones(lanes, np.float32)) for _ in range(design.model.kinds)
        ]
        self.scores = Scores(len(estimator.p), estimator.forgetting_s * windows_hz)
        self._left = np.ones(lanes, np.float32)  # of the older rows' information, behind a window
        self.errors = [OwnError(_F(one), lanes) for one in design.error_variance]
        self._follows = design.model.kinds > 1  # the errors follow the residuals
        self.alone = False
        self.candidate: Candidate = np.zeros_like(trust.estimate)

    # ---- number of stages

    def _entries(self) -> int:
        return _parts(len(self.design.noise), _ENTRIES_PER_STAGE)

    def _before_columns(self) -> int:
        """Stages of a kind before its columns."""
        basis = 2 * self.design.power + _parts(self.rows.harmonics, _SHARES_PER_STAGE)
        noise = 1 + (self._entries() + 1) * len(self.estimator.p) if self._checks_noise else 1
        return self._entries() + 2 + basis + noise

    def _reflections(self, kind: int) -> int:
        families = 1 if self.design.functions <= _BOTH_FAMILIES else 2
        return families * self.design.model.kind[kind].columns

    def _behind_projection(self, kind: int) -> int:
        """Stages of a kind from its residuals to its gate."""
        thetas = self.design.model.kind[kind].thetas
        residual = _parts(self.design.functions, max(1, _PRODUCTS_PER_STAGE // (thetas + 1)))
        return residual + _parts(thetas, self._products) + 1

    @property
    def _projections(self) -> int:
        """Columns that a stage projects."""
        return max(1, _PRODUCTS_PER_STAGE // (2 * self.design.functions))

    @property
    def _products(self) -> int:
        """Products of columns that a stage forms."""
        return max(1, _PRODUCTS_PER_STAGE // self.design.functions)

    def _adding(self, kind: int) -> int:
        """Stages with the products of the columns of a kind."""
        thetas = self.design.model.kind[kind].thetas
        return _parts(thetas * (thetas + 1) // 2, self._products)

    def _stages_of_rows(self, kind: int) -> int:
        """Stages of a kind up to its gate."""
        own = self.design.model.kind[kind]
        terms = [one.column for one in self.design.model.terms_of(kind)]
        gather = sum(max(1, terms.count(column)) for column in range(own.columns))
        project = sum(1 + _parts(own.columns - 1 - i, self._projections) for i in range(own.nuisances)) or 1
        return self._before_columns() + gather + self._reflections(kind) + project + self._behind_projection(kind)

    @property
    def _stages_of_pull(self) -> int:
        return (self._entries() if self.compensation else 1) + 1

    def _most_of_columns(self, kind: int) -> int:
        """Stages of a kind until its columns are formed, at most."""
        terms, columns = len(self.design.model.terms_of(kind)), self.design.model.kind[kind].columns
        return self._before_columns() + terms + columns + self._reflections(kind)

    def _most_of_kind(self, kind: int) -> int:
        """Stages of a kind, at most."""
        own = self.design.model.kind[kind]
        project = own.nuisances * (1 + _parts(own.columns - 1, self._projections)) + 1
        behind = self._behind_projection(kind) + self._entries() + 1 + self._adding(kind) + 1
        return self._most_of_columns(kind) + project + behind

    @property
    def stages_of_columns(self) -> int:
        """Of a window until all its columns are formed, at most."""
        last = self.design.model.kinds - 1
        return sum(self._most_of_kind(kind) for kind in range(last)) + self._most_of_columns(last)

    @property
    def stages(self) -> int:
        """Of a window with all its solves, at most."""
        estimator = self.estimator
        of_kinds = sum(self._most_of_kind(kind) for kind in range(self.design.model.kinds))
        solves = estimator.solve_stages(True) + (self.iterations - 1) * (estimator.solve_stages(False) + 1)
        return of_kinds + 7 + len(estimator.p) + solves + estimator.assess_solved_stages

    @property
    def _checks_noise(self) -> bool:
        """S is compared with the information of the sensors' noise; lanes have one margin."""
        return bool(self.estimator.noise_margin[0] > 0) and bool(self.design.noise)

    @property
    def _weight(self) -> Float32:
        """Of a window's rows [lanes]."""
        return np.asarray(
            (_F(self.design.functions) * _F(self.design.model.kinds)) * self.estimator.row_weight, np.float32
        )

    # ---- a window

    def process(self, window: Float32) -> Stages:
        """Processes the sums of a window [channels, 2, harmonics]: a stage a step; yields the reason to report [lanes],
        or None."""
        if self.alone:
            self.scores.skip()
        self.alone = False
        estimator = self.estimator
        lanes = estimator.p.shape[1]
        score = np.zeros((estimator.model.n_theta, lanes), np.float32)
        nothing = np.zeros(lanes, np.float32)
        expected, free, square, used = nothing, nothing, nothing, 0
        first = 0
        noise = Noise(estimator.model, estimator.p, self._weight)
        for kind, own in enumerate(self.design.model.kind):
            block = slice(first, first + own.thetas)
            theta = estimator.theta[block]
            white = White(self.rows, kind, theta, self.errors[kind].variance)
            if self._checks_noise:
                noise.add(white, first)
            first += own.thetas
            columns, live = projected(white.columns(parts_of_columns(white, window)), own.thetas)
            e, rss = _residuals(columns, theta)
            for _ in range(self._stages_of_rows(kind) - 1):
                yield None
            freedom = _F(self.design.functions) - live
            n = columns[: own.thetas]
            with np.errstate(all="ignore"):
                squares = np.array([total(one * one) for one in n])
            accepted = estimator.accept_rows(squares, rss)
            if not of_all_lanes(accepted == Reason.ACCUMULATED):
                yield accepted
                continue
            with np.errstate(all="ignore"):
                passes, opens = self.gates[kind].judge(rss / freedom)
            if not of_all_lanes(passes):
                estimator.counters["rejected_outlier"] += 1
                yield np.full(lanes, Reason.REJECTED_OUTLIER, np.uint8)
                continue
            if of_all_lanes(opens):
                self._begin_anew()
            if used == 0:
                factor = self._left * self.trust.next_fade_factor()
                self._left = np.ones(lanes, np.float32)
                with np.errstate(all="ignore"):
                    estimator.information.fade(factor)
                estimator.sums = estimator.information.read()
            used += 1
            free, square = free + freedom, square + rss
            yield None
            yield from self._pull(white, block, score)
            expected = expected + white.sensors()
            with np.errstate(all="ignore"):
                left = self.errors[kind].take(self.trust.arrived & self._follows, rss / freedom, white.error_share())
            self.gates[kind].begin_anew(left < 1)
            self._left = np.where(left < self._left, left, self._left)
            yield from self._add(kind, np.concatenate([n, e[None]]), squares, score[block], rss)
        if used == 0:
            self.scores.skip()
            return
        estimator.noise_alone = noise.s if self._checks_noise else None
        yield from self._steps(score, expected / _F(used), free, square)

    def _add(self, kind: int, columns: Float32, squares: Float32, score: Float32, rss: Float32) -> Stages:
        """Products of the columns of N and e [thetas + 1, rows, lanes] to the estimator, a few a stage."""
        thetas, moment, done = len(squares), 0, 0
        gradient = np.zeros_like(score)
        for i in range(thetas):
            self.estimator.add_moment(kind, moment, squares[i])
            moment += 1
            for j in range(i + 1, thetas + 1):
                with np.errstate(all="ignore"):
                    product = total(columns[i] * columns[j])
                    if j < thetas:
                        self.estimator.add_moment(kind, moment, product)
                        moment += 1
                    else:
                        gradient[i] = product
                        score[i] = score[i] + product
                        self.estimator.add_gradient(kind, i, product)
                done += 1
                if done % self._products == 0 and done < thetas * (thetas + 1) // 2:
                    yield None
        yield None
        self.estimator.end_rows(kind, gradient, rss, self.design.functions)
        yield None

    def _pull(self, white: White, block: slice, score: Float32) -> Stages:
        """The stages of the compensation, the last of which adds it."""
        estimator = self.estimator
        for _ in range(self._stages_of_pull - 1):
            yield None
        pull = np.zeros_like(score)
        if self.compensation:
            pull[block] = white.pull(white.full)
        with np.errstate(all="ignore"):
            score[block] = score[block] + pull[block]
        if self.compensation:
            estimator.add_to_b(pull)
        yield None

    def _steps(self, score: Float32, expected: Float32, free: Float32, square: Float32) -> Stages:
        """From the rows in the sums to the verdict."""
        estimator = self.estimator
        self.scores.take(estimator.model, estimator.p, score)
        yield None
        estimator.set_expected(expected)
        yield None
        reason = np.full(score.shape[1], Reason.ACCUMULATED, np.uint8)
        for iteration in range(self.trust.steps(self.iterations)):
            if iteration:
                yield None
            fallback = self.trust.fallback if iteration == 0 else None
            for solved in estimator.solve(ends_group=iteration == 0, fallback=fallback):
                yield None
                if solved is not None:
                    reason = solved
            if not estimator.was_due:
                break
        estimator.noise_alone = None
        size, group_rss = estimator.size, estimator.group_rss
        with np.errstate(all="ignore"):
            self.scores.add(square / free)
            variance_ratio = group_rss / (free * expected)
        yield None
        if not estimator.was_due:
            yield from self._judge(reason, size, estimator.everywhere, variance_ratio, self.trust.estimate)
            return
        for _ in range(1 + estimator.assess_solved_stages + len(estimator.p) + 1):
            yield None
        with np.errstate(all="ignore"):
            candidate, above_noise = estimator.judged_as_solved()
            self._cluster(candidate)
        yield from self._judge(reason, size, above_noise, variance_ratio, candidate)

    def _judge(
        self, reason: Reasons, size: Float32, above_noise: Mask, variance_ratio: Float32, candidate: Candidate
    ) -> Stages:
        """The verdict; a tick later the publication."""
        verdict = self.trust.decide(reason, size, above_noise, variance_ratio, candidate)
        yield None
        reported = self.trust.publish(verdict, reason, candidate)
        self.candidate = np.where(verdict == Reason.UPDATED, self.trust.estimate, candidate)  # with what it neglects
        if of_all_lanes(self._left < 1):
            self._begin_anew()
        yield reported

    def _begin_anew(self) -> None:
        """The rows so far count no more."""
        self.trust.begin_anew()
        self.scores.begin_anew()

    def _cluster(self, candidate: Candidate) -> None:
        """The larger of the two standard errors of each parameter; the covariance grows with it."""
        estimator = self.estimator
        n_p = len(estimator.p)
        covariance = np.moveaxis(candidate["covariance"], 0, 2)[:n_p, :n_p].copy()
        wide = estimator.judged_variance * estimator.correlation
        windows = np.asarray(candidate["weight"] / self._weight, np.float32)
        growth = np.ones((n_p, len(wide)), np.float32)
        for a in range(n_p):
            variance = self.scores.variance(a, covariance, wide, windows)
            se = candidate["se"][:, a]
            wider: Mask = (variance > se * se) & (variance <= _VARIANCE_MAX)
            candidate["se"][:, a] = np.where(wider, np.sqrt(variance), se)
            before = covariance[a, a]
            growth[a] = np.where(before > 0, candidate["se"][:, a] / np.sqrt(before), _F(1))
        for a in range(n_p):
            for b in range(n_p):
                candidate["covariance"][:, a, b] = covariance[a, b] * (growth[a] * growth[b])


def _residuals(columns: Float32, theta: Float32) -> tuple[Float32, Float32]:
    """e [rows, lanes] of the columns of thetas and Y at theta, and the sum of its squares [lanes]."""
    with np.errstate(all="ignore"):
        e = columns[-1]
        for j, one in enumerate(theta):
            e = e - one * columns[j]
        rss = np.zeros(e.shape[1], np.float32)
        for square in e * e:
            rss = rss + square
    return e, rss
