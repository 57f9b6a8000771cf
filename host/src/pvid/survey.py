"""What a whole run says of p before the core sees it: a start and a design for the weak form, whatever the guess.

The weak form's rows are summed in float64 over all windows of the run, and the least squares of these sums are searched
from several starts about the guess. Rows depend on p in three ways: by their design (window, test functions, filters
follow the modes), by their whitening, and by the constraints theta = f(p); the search renews all three until p stays.
Of the minima found the one with the smallest chi^2 is taken.

`fitted` returns the rig file with the outcome as its nominal pendulum: what a board would be given after a first run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid import oracle
from pvid.capture import Run
from pvid.errors import PvidError
from pvid.rigfile import Nominal, RigFile
from pvid.setup import NOISE_LSB, nominal_start, weak_design_of, weak_drive_threshold
from pvid.weak_design import WeakDesign
from pvid.weak_oracle import A, B, columns, frames, front_end, jacobian, noise_gram, theta
from pvid.weak_sizing import window_for_run

Float = npt.NDArray[np.float64]

# Starts: the guess with l2 and rho2 times each pair of these, itself first.
_SCALES = (1.0, 0.45, 2.2)
# Two outcomes are the same when no parameter differs by more than this; so many in agreement end the search.
_SAME = 0.02
_ENOUGH = 3
# The design is renewed until no parameter moves by more than this, and at most so often.
_MOVED = 0.1
_RENEWALS = 4
_WHITENINGS = 3
# Of a pendulum: L2 = d1 - d2 - 1 is (l2 / rho2)^2.
_LEAST_L2 = 0.02
# Windows with this many times the median residual energy hold a jolt or a lost sample, not the mechanism.
_JOLT = 25.0
_STEPS = 40
_LONGEST_STEP = 0.5  # of log w, log d1, log d2
_DONE = 1e-8


@dataclass(frozen=True)
class Survey:
    """Outcome of `survey`.

    Attributes
    ----------
    p : (w [1/s^2], d1, d2, c [rad])
    chi2 : variance of the rows over what the encoder's noise explains
    agreeing : starts that led there
    tried : starts tried
    """

    p: Float
    chi2: float
    agreeing: int
    tried: int


def fitted(rig: RigFile, run: Run) -> RigFile:
    """The rig file with the run's survey as its nominal pendulum and a window that the run holds often enough.

    Unchanged where the rig file asks for no survey (`[identifier] survey = false`) or for the strong form. Where the
    survey finds no pendulum the guess stays.
    """
    if rig.identifier.form != "weak" or not rig.identifier.survey:
        return rig
    found = survey(rig, run)
    known = rig if found is None else _with_nominal(rig, found.p)
    return _sized_for(replace(known, identifier=replace(known.identifier, survey=False)), run)


def survey(rig: RigFile, run: Run) -> Survey | None:
    """Searches a run for p; None where no start leads to a pendulum."""
    outcomes: list[tuple[float, Float]] = []
    tried = 0
    for start in _starts(rig):
        tried += 1
        try:
            outcome = _search(start, run)
        except (PvidError, np.linalg.LinAlgError):
            continue
        if outcome is not None:
            outcomes.append(outcome)
            best = min(outcomes, key=lambda one: one[0])
            if _agreeing(outcomes, best[1]) >= _ENOUGH:
                break
    if not outcomes:
        return None
    chi2, p = min(outcomes, key=lambda one: one[0])
    return Survey(p, chi2, _agreeing(outcomes, p), tried)


def _starts(rig: RigFile) -> Iterator[RigFile]:
    guess = rig.nominal
    for l2 in _SCALES:
        for rho2 in _SCALES:
            yield replace(rig, nominal=replace(guess, l2=guess.l2 * l2, rho2=guess.rho2 * rho2))


def _agreeing(outcomes: list[tuple[float, Float]], p: Float) -> int:
    return sum(bool(np.abs(np.log(one[:3] / p[:3])).max() < _SAME) for _, one in outcomes)


def _is_pendulum(p: Float) -> bool:
    return bool(np.isfinite(p).all() and (p[:3] > 0).all() and p[1] - p[2] - 1 > _LEAST_L2)


def _with_nominal(rig: RigFile, p: Float) -> RigFile:
    g, l2, rho2 = (float(x) for x in oracle.physical(p[:3], rig.l1))
    return replace(rig, nominal=Nominal(g=g, l2=l2, rho2=rho2))


def _sized_for(rig: RigFile, run: Run) -> RigFile:
    """With a window that the run holds often enough, where the rig file does not fix one."""
    if rig.identifier.window_s > 0:
        return rig
    window_s = window_for_run(nominal_start(rig), len(run.t) / run.sample_rate)
    return rig if window_s is None else replace(rig, identifier=replace(rig.identifier, window_s=window_s))


def _search(rig: RigFile, run: Run) -> tuple[float, Float] | None:
    """chi^2 and p of the minimum that a start leads to; None if that is no pendulum."""
    p = np.append(nominal_start(rig), np.nanmean(run.phi))
    chi2 = math.nan
    for _ in range(_RENEWALS):
        design = weak_design_of(_sized_for(rig, run), run.sample_rate)
        rows = _rows_of(rig, run, design)
        before = p
        p, chi2 = _fit(rows, design, rig, p)
        if not _is_pendulum(p):
            return None
        if np.abs(np.log(p[:3] / before[:3])).max() < _MOVED:
            break
        rig = _with_nominal(rig, p)
    return chi2, p


def _rows_of(rig: RigFile, run: Run, design: WeakDesign) -> Float:
    """Columns Y, N1..N8, a, b of the driven windows without missing samples: [windows, 11, K]."""
    present = np.isfinite(run.phi) & np.isfinite(run.y)
    phi, y = (_bridged(x, present) for x in (run.phi, run.y))
    smooth, u = front_end(phi, y, design)
    phi_frames, u_frames = frames(smooth, design), frames(u, design)
    driven = np.var(u_frames, axis=1) >= weak_drive_threshold(rig, design) ** 2
    if not present.all():
        driven &= _whole(present, design, len(phi_frames))
    if not driven.any():
        raise PvidError("the pivot stands still in every window of the run")
    return columns(phi_frames[driven], u_frames[driven], design)


def _bridged(x: Float, present: npt.NDArray[np.bool_]) -> Float:
    if present.all():
        return x
    at = np.flatnonzero(present)
    return np.interp(np.arange(len(x)), at, x[at])


def _whole(present: npt.NDArray[np.bool_], design: WeakDesign, windows: int) -> npt.NDArray[np.bool_]:
    """Which windows lack no sample."""
    missing = np.concatenate([[0], np.cumsum(~present)])
    first = design.decimation * design.hop * np.arange(windows)
    last = first + design.taps + design.decimation * (design.window - 1)
    return np.asarray(missing[np.minimum(last, len(present))] == missing[first])


def _fit(rows: Float, design: WeakDesign, rig: RigFile, p: Float) -> tuple[Float, float]:
    """p of the least squares, whitened at p itself, and chi^2; windows with a jolt are left out once it is known."""
    kept = np.ones(len(rows), np.bool_)
    moments = np.empty(0)
    for turn in range(_WHITENINGS):
        white = _whitened(rows, design, p)
        if turn > 0:
            residual = white[:, 0] - np.einsum("j,wjk->wk", theta(p), white[:, 1:])
            energy = np.sum(residual**2, axis=1)
            kept = energy <= _JOLT * np.median(energy)
        moments = np.einsum("wik,wjk->ij", white[kept], white[kept])
        p = _least_squares(moments, p)
    freedom = int(kept.sum()) * (design.functions - 2) - len(p)
    row_variance = max(rig.sensor.phi_lsb * NOISE_LSB, 1e-8) ** 2 / design.decimation
    return p, _energy(moments, p) / max(freedom, 1) / row_variance


def _whitened(rows: Float, design: WeakDesign, p: Float) -> Float:
    """Rows [windows, 9, K] whose noise is white at p, without what a and b explain."""
    inverse = np.linalg.inv(np.linalg.cholesky(noise_gram(design, p)))
    white = rows @ inverse.T
    for column in (A, B):
        direction = white[:, column]
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        direction = np.divide(direction, length, out=np.zeros_like(direction), where=length > 0)
        white = white - np.einsum("wik,wk->wi", white, direction)[:, :, None] * direction[:, None, :]
    return np.asarray(white[:, :A])


def _energy(moments: Float, p: Float) -> float:
    """Sum of squares of Y - N^T theta(p), from the moments of (Y, N)."""
    weights = np.append(1.0, -theta(p))
    return float(weights @ moments @ weights)


def _least_squares(moments: Float, p: Float) -> Float:
    """Constrained least squares of theta(p) by damped Gauss-Newton in (log w, log d1, log d2, c)."""
    m, b = moments[1:, 1:], moments[1:, 0]
    damping, energy = 1e-3, _energy(moments, p)
    for _ in range(_STEPS):
        c = jacobian(p) * np.array([*p[:3], 1.0])
        information, force = c.T @ m @ c, c.T @ (b - m @ theta(p))
        scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
        normal = information * np.outer(scale, scale)
        step = np.zeros(4)
        better = False
        while not better and damping < 1e12:
            step = scale * np.linalg.solve(normal + damping * np.eye(4), scale * force)
            step[:3] = np.clip(step[:3], -_LONGEST_STEP, _LONGEST_STEP)
            there = np.append(p[:3] * np.exp(step[:3]), p[3] + step[3])
            now = _energy(moments, there)
            better = now <= energy
            damping *= 1 / 8 if better else 4
        if not better:
            break
        p, energy = there, now
        if np.abs(step[:3]).max() < _DONE:
            break
    return p
