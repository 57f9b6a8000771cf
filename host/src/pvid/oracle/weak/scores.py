"""How much of what is unexplained does a term explain, how large is it, and how far is p off without it?

A term of size a adds a c to the whitened residual rows r. To first order at an estimate, with J the slopes of the rows
in p and S their information,

    rest = c - J S^-1 J^T c,    a = rest.r / rest.rest,    shift of p = -S^-1 J^T c a.

Noise in J is taken off J^T J, and its bias off J^T r, as in the estimate: else a column that is free of noise would
take over what the noise hides of the motion.

What counts is the share of the residuals' energy that the term removes from windows that neither p nor a has seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak import work
from pvid.oracle.weak.channels import Record
from pvid.oracle.weak.errors import clustered_variance, of_noise
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import WhiteRows
from pvid.oracle.weak.solve import Fit, inverse, pulls
from pvid.oracle.weak.terms import Candidate, Change

FOLDS = 4  # contiguous parts of each recording: p and sizes from three, the share on the fourth

# A column of which the parameters, or one of them, explain all but this part is theirs: no data show it.
_OWN, _OF_ONE = 1e-6, 1e-5

# What replaces a signal as a whole has a column of size 1.
_WHOLE = (0.4, 2.5)

_MOST_NOISE = 0.9  # of the information along any direction, that is taken off

_TOGETHER = 16  # candidates
_OF_SCORE = 2e-5  # units of work for an entry of a column


def between(before: Record, after: Record, windows: npt.NDArray[np.int64], step: float) -> Change:
    """Residuals of some windows with the channels `after` less those with the channels `before`, over a step."""
    functions, other = (one.grid.design.test_functions for one in (before, after))
    apart = []
    for row in before.channels.rows:
        own: dict[int, Float] = {}
        for term in row.terms:
            was, now = before.rows(functions, term), after.rows(other, term)
            if len(was) != len(now):
                raise PvidError("the other run has a gap")
            if term.column <= row.thetas and was is not now:
                more = term.factor / step * (now[windows] - was[windows])
                own[term.column] = own[term.column] + more if term.column in own else more
        apart.append(own)

    def change(theta: Sequence[Float]) -> list[Float]:
        weights = [np.append(-th, 1.0) for th in theta]
        none = np.zeros((len(windows), functions.count))
        return [sum((w[k] * one for k, one in own.items()), none) for own, w in zip(apart, weights, strict=True)]

    return change


class Scores:
    """Of one estimate."""

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        self.theta = fit.parameters.theta(fit.p)
        self.slopes = np.concatenate(fit.designs(), axis=1)  # [windows, rows of all kinds, n_p]
        self.residuals = np.concatenate(fit.residuals(), axis=1)
        self.prior = np.diag(fit.parameters.prior(fit.start))
        self.unit = fit.parameters.unit(fit.p)
        self.tangent = fit.tangent
        s = np.einsum("wkp,wkq->pq", self.slopes, self.slopes) + self.prior
        self._noise, self._pull = self._of_noise(s)  # a window
        self.inverse = inverse(s - len(self.slopes) * self._noise, self.tangent)
        self._beside = inverse(s, self.tangent)

    def _of_noise(self, s: Float) -> tuple[Float, Float]:
        """Part of each window's slopes by slopes that is noise, and what its slopes by residuals lack for it; 0 of an
        estimate without compensation."""
        fit, none = self.fit, (np.zeros_like(s), np.zeros(len(s)))
        jacobian = fit.parameters.jacobian(fit.p)
        lacks = np.zeros(len(s))
        for one, pull in zip(fit.white, pulls(fit.rows, fit.white, self.theta), strict=True):
            lacks += np.concatenate([jacobian[kind] for kind in one.kinds]).T @ pull
        gradient, own = np.einsum("wkp,wk->p", self.slopes, self.residuals), inverse(s, self.tangent)
        if (gradient + lacks) @ own @ (gradient + lacks) > gradient @ own @ gradient:
            return none
        noise = of_noise(fit)
        most = float(np.max(np.abs(np.linalg.eigvals(own @ noise)), initial=0.0))
        part = min(1.0, _MOST_NOISE / most) if most > 0 else 0.0
        return part * noise / len(self.slopes), part * lacks / len(self.slopes)

    def shift(self, one: Candidate) -> Float:
        """What p moves by when a term of size 1 is added [n_p]."""
        return self.shift_by(one.changed(self.theta))

    def change_to(self, record: Record, step: float) -> Change:
        """Residuals with other channels less those with the recorded ones, over a step."""
        return between(self.fit.rows.record, record, self.fit.rows.numbers, step)

    def shift_by(self, change: Sequence[Float]) -> Float:
        """What p moves by when each kind's raw residuals change by so much [windows, K] [n_p]."""
        moved = np.einsum("wkp,wk->p", self.slopes, self.whitened(change))
        return np.asarray(-self.unit * (self.inverse @ moved))

    def white(self, candidates: Sequence[Candidate]) -> Float:
        """Columns of candidates [windows, candidates, rows of all kinds]."""
        return self._whitened([one.changed(self.theta) for one in candidates])

    def whitened(self, change: Sequence[Float]) -> Float:
        """Of the change of each kind's raw residuals [windows, K]: [windows, rows of all kinds]."""
        return np.asarray(self._whitened([change])[:, 0])

    def _whitened(self, changes: Sequence[Sequence[Float]]) -> Float:
        out = np.zeros((len(self.residuals), len(changes), self.residuals.shape[1]))
        first = 0
        for white in self.fit.white:
            raw = [np.concatenate([one[kind] for kind in white.kinds], axis=1) for one in changes]
            there = [k for k, one in enumerate(raw) if one.any()]
            end = first + raw[0].shape[1]
            if there:
                own = white.whitener.of(np.stack([raw[k] for k in there], axis=1))
                out[:, there, first:end] = self._without_nuisances(white, own)
            first = end
        return out

    def _without_nuisances(self, white: WhiteRows, rows: Float) -> Float:
        plans = self.fit.rows.compiled.channels.rows
        if not any(plans[kind].nuisances for kind in white.kinds):
            return rows
        q = np.linalg.qr(self.fit.rows.white_nuisances(white.kinds, white.whitener).transpose(0, 2, 1))[0]
        return np.asarray(rows - (rows @ q) @ q.transpose(0, 2, 1))

    @cached_property
    def _folds(self) -> list[npt.NDArray[np.intp]]:
        """Windows of each part of the run."""
        fold = self.fit.rows.parts(FOLDS)
        return [np.flatnonzero(fold == part) for part in range(FOLDS)]

    def by_parts(self) -> Float:
        """What p moves by when the run's parts are left out one by one: standard error of the jackknife [n_p]."""
        jj, jr, _ = self._of_parts
        whole, b = jj.sum(axis=0) + self.prior, jr.sum(axis=0)
        without = np.array(
            [self.unit * (inverse(whole - a, self.tangent) @ (b - c)) for a, c in zip(jj, jr, strict=True)]
        )
        return np.asarray(np.sqrt((FOLDS - 1) * np.mean((without - without.mean(axis=0)) ** 2, axis=0)))

    def rests(self, candidates: Sequence[Candidate]) -> Float:
        """Columns beside all parameters, of length 1 [candidates, windows * rows of all kinds]."""
        n = self.slopes.shape[-1]
        c = self.white(candidates).transpose(1, 0, 2).reshape(len(candidates), -1)
        slopes = self.slopes.reshape(-1, n)
        rest = c - (c @ slopes) @ self._beside.T @ slopes.T
        return np.asarray(rest / np.maximum(np.linalg.norm(rest, axis=1, keepdims=True), 1e-300))

    def by_noise(self, one: Candidate, noise: Change, noise_in: Change) -> float:
        """Part of what a term seems to explain that it does because it has the noise of the residuals in it.

        Parameters
        ----------
        noise, noise_in : what as much noise again adds to the residuals, and to the term
        """
        c, its, r = (self.whitened(change(self.theta)) for change in (one.changed, noise_in, noise))
        mixed = np.einsum("wkp,wk->p", self.slopes, c) @ self.inverse
        of_noise = np.einsum("wkp,wk->p", self.slopes, its) @ self.inverse
        explained = float(np.sum(c * self.residuals) - self._of_parts[1].sum(axis=0) @ mixed)
        return float(np.sum((its - self.slopes @ of_noise) * r)) / explained if explained else 0.0

    def leaves(self, one: Candidate) -> float:
        """Part of the equations' own terms that is left when a term is added, constants aside: where next to nothing
        is, 0 = 0 explains every run.
        """
        after, out = self.fit.parameters.theta(self.fit.p + one.shift), 1.0
        for columns, sizes, own, before, then in zip(
            self.fit.rows.columns, self._sizes, one.changed(self.theta), self.theta, after, strict=True
        ):
            if np.any(own):
                left = np.sum(self._varying(columns[:, len(then)] - one.size * own) ** 2)
                whole = np.sum(sizes[:-1] * np.square(before)) + sizes[-1]
                out = min(out, float((left + np.sum(sizes[:-1] * np.square(then))) / max(whole, 1e-300)))
        return out

    @cached_property
    def _sizes(self) -> list[Float]:
        """Sums of squares of the raw columns of each row kind, theta's and then Y's, constants aside."""
        return [
            np.array([np.sum(self._varying(columns[:, k]) ** 2) for k in range(len(th) + 1)])
            for columns, th in zip(self.fit.rows.columns, self.theta, strict=True)
        ]

    @cached_property
    def _constant(self) -> Float:
        """Raw column of a constant, of length 1 [windows, K]."""
        rows = self.fit.rows
        sums = rows.functions.window_sums(np.ones((1, rows.record.grid.size)))[0][rows.numbers]
        own = sums @ rows.functions.combine(0)
        return np.asarray(own / np.linalg.norm(own))

    def _varying(self, column: Float) -> Float:
        return np.asarray(column - np.sum(column * self._constant) * self._constant)

    def of(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """With their scores, that of the largest share first."""
        distinct = len({id(one.change) for one in candidates})  # courses of one column are its sums, weighted
        work.spend(_OF_SCORE * self.residuals.size * distinct)
        out = [
            one
            for first in range(0, len(candidates), _TOGETHER)
            for one in self._scored(candidates[first : first + _TOGETHER])
        ]
        return sorted(out, key=lambda one: -one.share)

    @cached_property
    def _of_windows(self) -> tuple[Float, Float]:
        """Of each window, slopes by slopes and slopes by residuals [windows, n_p, n_p], [windows, n_p]."""
        turned = self.slopes.transpose(0, 2, 1)
        return turned @ self.slopes - self._noise, (turned @ self.residuals[..., np.newaxis])[..., 0] + self._pull

    @cached_property
    def _of_parts(self) -> tuple[Float, Float, Float]:
        """Of each part, slopes by slopes, slopes by residuals, and the square of the residuals."""
        jj, jr = (np.array([of[own].sum(axis=0) for own in self._folds]) for of in self._of_windows)
        return jj, jr, np.array([float(np.sum(self.residuals[own] ** 2)) for own in self._folds])

    def _scored(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Some of them, so few that their columns stay in the processor's cache."""
        r, (jj, jr, rr), (each_jj, each_jr) = self.residuals, self._of_parts, self._of_windows
        columns = {id(one.change): one.change for one in candidates}
        column = [list(columns).index(id(one.change)) for one in candidates]
        weight = np.array([np.ones(len(r)) if one.weights is None else one.weights for one in candidates]).T
        c = self._whitened([change(self.theta) for change in columns.values()]).transpose(0, 2, 1)
        each_jc = (self.slopes.transpose(0, 2, 1) @ c)[:, :, column] * weight[:, np.newaxis]
        each_cc = np.einsum("wkc,wkc->wc", c, c)[:, column] * weight**2
        each_cr = np.einsum("wkc,wk->wc", c, r)[:, column] * weight
        jc, cc, cr = (np.array([of[own].sum(axis=0) for own in self._folds]) for of in (each_jc, each_cc, each_cr))

        mix, step = self.inverse @ jc.sum(axis=0), self.inverse @ jr.sum(axis=0)
        own = cc.sum(axis=0) - np.einsum("pc,pc->c", jc.sum(axis=0), mix)
        part_of_its_own = own / np.maximum(cc.sum(axis=0), 1e-300)
        sizes = np.sqrt(np.maximum(np.einsum("dpp->p", jj)[:, np.newaxis] * cc.sum(axis=0), 1e-300))
        beside_each = 1 - np.max(np.abs(jc.sum(axis=0)) / sizes, axis=0, initial=0.0) ** 2
        real = (part_of_its_own > _OWN) & (beside_each > _OF_ONE)
        own = np.where(real, own, 1.0)
        size = np.where(real, (cr.sum(axis=0) - jr.sum(axis=0) @ mix) / own, 0.0)
        squared = each_jj.reshape(len(r), -1) @ (mix[:, np.newaxis] * mix).reshape(-1, len(candidates))
        moves = each_cr - np.einsum("wpc,p->wc", each_jc, step) - (each_jr - each_jj @ step) @ mix
        moves -= size * (each_cc - 2 * np.einsum("wpc,pc->wc", each_jc, mix) + squared)
        error = np.sqrt(clustered_variance(moves, np.diag(1 / own)))
        shift = -self.unit[:, np.newaxis] * mix * size

        gains, before = np.zeros((FOLDS, len(candidates))), 0.0
        for part in range(FOLDS):
            b, mixed = jr.sum(axis=0) - jr[part], jc.sum(axis=0) - jc[part]
            others = inverse(jj.sum(axis=0) - jj[part] + self.prior, self.tangent)
            plain, moved = others @ b, others @ mixed
            whole = cc.sum(axis=0) - cc[part]
            beside = whole - np.einsum("pc,pc->c", mixed, moved)
            found = (cr.sum(axis=0) - cr[part] - b @ moved) / np.where(beside > _OWN * whole, beside, np.inf)
            p = plain[:, np.newaxis] - moved * found
            without = rr[part] - 2 * jr[part] @ plain + plain @ jj[part] @ plain
            with_it = rr[part] - 2 * (jr[part] @ p + cr[part] * found) + np.einsum("pc,pq,qc->c", p, jj[part], p)
            with_it += 2 * found * np.einsum("pc,pc->c", jc[part], p) + found**2 * cc[part]
            gains[part], before = without - with_it, before + without
        share = gains.sum(axis=0) / max(float(before), 1e-300)

        for place, one in enumerate(candidates):
            if one.leveled:
                real[place] &= _WHOLE[0] < size[place] < _WHOLE[1]
            else:
                real[place] &= abs(size[place]) < one.most
        certainty = np.where(real, np.abs(size) / np.maximum(error, 1e-300), 0.0)
        return [
            replace(
                one,
                size=float(size[k]),
                certainty=float(certainty[k]),
                by_noise=float(abs(size[k]) * np.sqrt(own[k])) if real[k] else 0.0,
                own=float(part_of_its_own[k]),
                share=float(share[k]) if real[k] else 0.0,
                folds=int(np.sum(gains[:, k] > 0)),
                shift=shift[:, k],
            )
            for k, one in enumerate(candidates)
        ]
