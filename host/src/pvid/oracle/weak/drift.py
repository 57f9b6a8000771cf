"""The course of parameters that drift along given directions alone, from all windows of a run: theory.md 4, (6d), (6e).

Forwards what the windows contain along D grows old, as in the core, where each kind of rows forgets by itself; then
each window gets, backwards, what the later ones contain: the smoother of the random walk that the law assumes. All
windows are linearised about the course before, so that D may turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.model.drifted import Drifted
from pvid.model.evaluation import numpy_function
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import inflation, uncertainty
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.rows import WeakRows, ready
from pvid.oracle.weak.solve import Fit, Moments, compensated, inverse

_ROUNDS = 8
_STAYS = 0.02  # standard errors: a course that moves by less ends them
_FOR_EVER = 1e12  # [s] from one recording to the next: nothing is left
_TIED = 1e8  # information of a constraint over that of all windows along it


def with_drift(
    compiled: CompiledModel, run: Mapping[str, npt.ArrayLike], design: WeakDesign, start: Float | None, errors: bool
) -> tuple[CompiledModel, Float | None]:
    """A model with drifts, with the course of its parameters in a run, and their end.

    Raises one of FAILURES where the numbers run away.

    Parameters
    ----------
    start, errors : as of `gated`
    """
    for _ in range(_ROUNDS):
        fit = gated(WeakRows.of(ready(compiled), run, design), start, errors)
        before, now = compiled.drifted, followed(fit)
        compiled, start = replace(compiled, drifted=now), now.p[-1]
        if before is not None and np.max(np.abs(now.p - before.at(now.t)) / now.se) < _STAYS:
            break
    return compiled, start


def followed(fit: Fit) -> Drifted:
    """The course, from a fit to rows without that of the round before."""
    parameters, rows, model = fit.parameters, fit.rows, fit.rows.compiled.bare
    half, ends, before = rows.functions.hop * rows.functions.dt, rows.end_times(), model.drifted
    t = np.concatenate([[ends[0] - 2 * half], ends - half, [ends[-1]]])  # the begin, windows, the end
    recordings, nodes, n = np.pad(rows.recordings, 1, mode="edge"), len(t), len(fit.p)
    about = np.tile(fit.p, (nodes, 1)) if before is None else before.at(t)
    end = fit.p if before is None else before.p[-1]
    share = inflation(fit) * max(1.0, uncertainty(fit).weighted_chi2)  # neighbours have samples in common
    s, f = (np.pad(one / share, ((1, 1), *[(0, 0)] * (one.ndim - 1))) for one in _moments(fit, about[1:-1], end))
    prior = parameters.prior(fit.start) / parameters.unit(fit.start) ** 2
    anchored = np.array([one in model.anchors for one in model.p])
    of_p = numpy_function(model.p, [[model.with_knowns(one) for one in way] for way in model.drifts])
    ways = np.array([of_p(*one) for one in about], np.float64).transpose(0, 2, 1)
    lasts = np.where(np.diff(recordings) == 0, np.diff(t), _FOR_EVER)
    per_second = np.einsum("wpk,wpq,wqk->k", ways, s, ways) / float(np.sum(np.diff(t)))

    def forwards(memory: float) -> Forwards:
        start = np.diag(prior), prior * anchored * (parameters.guess - end)
        return Forwards.of(*start, s, f, ways, np.outer(lasts, 1 / np.maximum(per_second * memory**2, 1e-300)))

    memory = _likeliest(lambda one: forwards(one).likelihood, model.drift_s if before is None else before.memory_s)
    own = forwards(memory)
    p, covariance, change = own.smoothed()
    so_far = np.array([inverse(s) @ f for s, f in zip(own.s, own.f, strict=True)])
    first, last = (_lag(t, p, sign * memory) for sign in (1, -1))
    spread = np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0)
    se = np.sqrt(spread + [first**2, *np.zeros((nodes - 2, n)), last**2])
    change_se = np.sqrt(np.maximum(change, 0) + (last - first) ** 2)
    excess = covariance[-1] - inverse(np.diag(prior) + s.sum(axis=0)) + np.outer(last, last)
    p, so_far = (np.clip(end + one, parameters.low, parameters.high) for one in (p, so_far))
    return Drifted(model.p_names, t, p, ends, so_far[1:-1], se, change_se, excess, memory)


def _lag(t: Float, p: Float, memory: float) -> Float:
    """By how much the end of a drift that goes on [n_p] is behind: what it changes by in one memory, nearby."""
    end = t[0] if memory > 0 else t[-1]
    far, near = (np.array([np.interp(end + k * memory, t, one) for one in p.T]) for k in (4, 2))
    return np.asarray((far - near) / 2)


@dataclass(frozen=True)
class Forwards:
    """The law over all windows.

    Attributes
    ----------
    s, f : behind each window [windows, n_p, n_p], [windows, n_p]
    gone : part of a step of p that the drift behind a window takes [windows, n_p, n_p]
    spare : what the smoother takes off a covariance [windows, n_p, n_p]
    likelihood : its logarithm, but for a constant
    """

    s: Float
    f: Float
    gone: Float
    spare: Float
    likelihood: float

    @classmethod
    def of(cls, now: Float, force: Float, s: Float, f: Float, ways: Float, steps: Float) -> Forwards:
        """From the start's information; steps: variances of the walk behind each window [windows - 1, drifts]."""
        all_s, gone, spare = np.zeros((3, *s.shape))
        all_f, likelihood = np.zeros_like(f), 0.0
        for w, d in enumerate(ways):
            now, force = now + s[w], force + f[w]
            all_s[w], all_f[w] = now, force
            if w < len(steps):
                of_d = now @ d
                whole = np.eye(d.shape[1]) + d.T @ of_d * steps[w]
                taken = steps[w][:, np.newaxis] * np.linalg.inv(whole)
                gone[w], spare[w] = d @ taken @ of_d.T, d @ (taken - taken @ d.T @ of_d @ taken) @ d.T
                likelihood += (force @ d @ taken @ d.T @ force - np.linalg.slogdet(whole)[1]) / 2
                now, force = now - now @ gone[w], force - gone[w].T @ force
        likelihood += (force @ inverse(now) @ force - np.linalg.slogdet(now)[1]) / 2
        return cls(all_s, all_f, gone, spare, likelihood)

    def smoothed(self) -> tuple[Float, Float, Float]:
        """p at each window from all of them [windows, n_p], its covariance [windows, n_p, n_p], and the variance of its
        change from the first to the last [n_p]."""
        covariance = np.array([inverse(one) for one in self.s])
        p = np.einsum("wij,wj->wi", covariance, self.f)
        cross = covariance[-1]
        for w in range(len(p) - 2, -1, -1):
            stays = np.eye(p.shape[1]) - self.gone[w]
            p[w] = stays @ p[w + 1] + self.gone[w] @ p[w]
            covariance[w] += stays @ (covariance[w + 1] - covariance[w]) @ stays.T - self.spare[w]
            cross = stays @ cross
        return p, covariance, np.diag(covariance[0] + covariance[-1] - 2 * cross)


def _likeliest(likelihood: Callable[[float], float], memory: float) -> float:
    """The memory of most likelihood [s], from another one on."""
    best, factor = likelihood(memory), 4.0
    while factor > 1.1:
        found = {one: likelihood(one) for one in (memory / factor, memory * factor)}
        one = max(found, key=lambda key: found[key])
        if found[one] > best + 0.01:
            memory, best = one, found[one]
        else:
            factor **= 0.5
    return memory


def _moments(fit: Fit, about: Float, end: Float) -> tuple[Float, Float]:
    """S [windows, n_p, n_p] and F [windows, n_p] of each window, of p - end, linearised at p about it [windows, n_p].

    The rows of the fit are without the way from each p to the end.
    """
    parameters, theta = fit.parameters, fit.parameters.theta(end)
    slopes = [[one / parameters.unit(p) for one in parameters.jacobian(p)] for p in about]
    s, f = np.zeros((*about.shape, about.shape[1])), np.zeros(about.shape)
    plain = Moments.of(fit.white)
    pulls = compensated(fit.rows, fit.white, parameters.theta(fit.p))
    for white, b, a in zip(fit.white, pulls.b, plain.b, strict=True):
        own = np.array([np.concatenate([one[kind] for kind in white.kinds]) for one in slopes])
        design = white.regressors.transpose(0, 2, 1) @ own
        e = white.residuals(theta) + np.einsum("wrp,wp->wr", design, about - end)
        s += design.transpose(0, 2, 1) @ design
        f += np.einsum("wrp,wr->wp", design, e) + np.einsum("wtp,t->wp", own, (b - a) / len(about))
    if parameters.model.constraints:
        whole = s.sum(axis=0)
        for w, p in enumerate(about):
            g, a = parameters.constraints(p)
            a = a / parameters.unit(p)
            weight = _TIED * np.sum((a @ whole) * a, axis=1) / np.sum(a**2, axis=1) ** 2
            s[w] += (a.T * weight) @ a
            f[w] += (a.T * weight) @ (a @ (p - end) - g)
    return s, f
