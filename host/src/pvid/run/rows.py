"""Rows of the weak form for all windows of a run at once, in float64, and the least squares over them.

    samples -> RunRows (columns of every driven window) -> corrected for large angles at p -> whitened at p -> Fit

Source: theory, 4 (constrained least squares) and 5 (weak form); the same rows as pvid.oracle.weak, which processes them
window by window as the core does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.weak import WeakDesign, disturbance_gram
from pvid.models.kapitza import MODEL
from pvid.oracle.self_consistent import self_consistent
from pvid.oracle.weak import A, N, columns, frames, front_end, jacobian, noise_gram, packed_to_square, theta
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.setup.f32 import row_sd_of, weak_drive_threshold

Float = npt.NDArray[np.float64]

# Windows with more than this many times the median residual energy contain a jolt or a lost sample and are left out.
JOLT = 25.0
_WHITENINGS = 3
_STEPS = 40
_LONGEST_STEP = 0.5  # of log w, log d1, log d2
_DONE = 1e-8
_FAR = math.log(1e3)  # a search that moved w, d1 or d2 so far to implausible values diverges
# Fewer windows are not evaluated.
FEWEST = 4
_MAPPED, _CORE = MODEL.n_mapped, len(MODEL.published)  # without the offset, with it; friction adds two


@dataclass(frozen=True)
class Fit:
    """Least squares over whitened rows, at p = (w, d1, d2, c), with friction (w, d1, d2, c, c1, c2).

    Attributes
    ----------
    p : the estimate
    chi2 : residual variance of the rows over that of the encoder's noise and of the disturbance, if there is one
    information : S = C^T M C [n_p, n_p]
    scores : C^T N e of each window [windows, n_p]; they sum to 0 at the least squares
    energy, signal : sums of squares of e and of Y over each window's rows [windows]
    row_sd : noise of a row [rad]
    """

    p: Float
    chi2: float
    information: Float
    scores: Float
    energy: Float
    signal: Float
    row_sd: float

    @property
    def clustered_se(self) -> Float:
        """Standard errors of p [n_p] from the scatter of the windows' scores g, without a model of the noise.

        S^-1 (sum g g^T) S^-1, with the products of neighbours, which share samples, if this is larger; increased for
        a short run with few windows.
        """
        windows = len(self.scores)
        inverse = np.linalg.pinv(self.information, hermitian=True)
        moved = self.scores @ inverse  # by each window; a sum of squares, which rounding cannot make negative
        variance = np.sum(moved**2, axis=0)
        with_neighbours = variance + 2 * np.sum(moved[:-1] * moved[1:], axis=0)
        few = windows / max(windows - 2, 1)
        return np.asarray(np.sqrt(np.maximum(variance, with_neighbours) * few))


@dataclass(frozen=True)
class RunRows:
    """Columns Y, N1..N8, with friction two more, a, b [windows, 11 or 13, K] of the driven windows, their angle and u
    [windows, W], their numbers in the run [windows]."""

    design: WeakDesign
    row_sd: float
    columns: Float
    phi: Float
    u: Float
    number: npt.NDArray[np.int64]
    part: float = 1.0  # of the run's windows
    sound: npt.NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, rig: RigFile, run: Run, design: WeakDesign) -> RunRows:
        """Rows of the windows that are driven and lack no sample.

        Raises
        ------
        PvidError
            When there is none.
        """
        present = np.isfinite(run.phi) & np.isfinite(run.y)
        phi, y = (_bridged(x, present) for x in (run.phi, run.y))
        smooth, u = front_end(phi, y, design)
        phi_frames, u_frames = frames(smooth, design), frames(u, design)
        usable = np.var(u_frames, axis=1) >= weak_drive_threshold(rig, design) ** 2
        if not present.all():
            usable &= _whole(present, design, len(phi_frames))
        if not usable.any():
            raise PvidError("the pivot rests in every window of the run")
        number = np.flatnonzero(usable)
        phi_frames, u_frames = phi_frames[number], u_frames[number]
        of_both = columns(phi_frames, u_frames, design)
        return cls(design, row_sd_of(rig, design.decimation), of_both, phi_frames, u_frames, number)

    @property
    def spans(self) -> Float:
        """First and last instant of each window's samples, from the run's first sample on [windows, 2] in s."""
        design = self.design
        first = self.number * design.hop * design.decimation
        last = first + design.taps - 1 + design.decimation * (design.window - 1)
        return np.stack([first, last], axis=1) / design.sample_rate

    def only(self, which: npt.NDArray[np.bool_] | slice) -> RunRows:
        """Some of the windows."""
        return replace(
            self,
            columns=self.columns[which],
            phi=self.phi[which],
            u=self.u[which],
            number=self.number[which],
            sound=None if self.sound is None else self.sound[which],
        )

    def thinned(self, most: int) -> RunRows:
        """At most so many windows, evenly spread over the run."""
        fewer = self.only(slice(None, None, -(-len(self.phi) // most)))
        return replace(fewer, part=self.part * len(fewer.phi) / len(self.phi))

    def within(self, zero: float, angle: float, fewest: int) -> RunRows:
        """The windows whose angle stays within +-`angle` of `zero` [rad]; all of them where those are too few."""
        inside = np.abs(self.phi - zero).max(axis=1) <= angle
        return self.only(inside) if int(inside.sum()) >= fewest else self

    def corrected(self, p: Float, full_angle: bool = True) -> RunRows:
        """Rows with the remainder of large angles at p subtracted from Y, and with the columns of friction if p has its
        two coefficients. `sound`: windows in which the remainder was found; the others remain linear."""
        friction = len(p) > _CORE
        damping = p[_CORE:] if friction else None
        y = np.zeros((len(self.phi), self.design.functions))
        k = np.zeros((len(self.phi), 2, self.design.functions))
        sound = np.zeros(len(self.phi), np.bool_)
        for window, (one, phi, u) in enumerate(zip(self.columns, self.phi, self.u, strict=True)):
            neglected = self_consistent(p[:_CORE], damping, one, phi, u, self.design, full_angle)
            if neglected is not None:
                y[window], k[window], sound[window] = neglected.y, neglected.k, True
        parts = [self.columns[:, :1] - y[:, None], self.columns[:, N], self.columns[:, A:]]
        if friction:
            parts.insert(2, k)
        return replace(self, columns=np.concatenate(parts, axis=1), sound=sound)

    def sound_only(self) -> RunRows:
        """The windows that could be corrected."""
        return self if self.sound is None else self.only(self.sound)

    def covariance(self, p: Float) -> Float:
        """Covariance of a window's rows at p for a decimated angle with noise of unit variance [K, K]."""
        return noise_gram(self.design, p)

    def covariance_of_disturbance(self, p: Float) -> Float:
        """Covariance of a window's rows at p for a unit disturbance [K, K]."""
        return packed_to_square(disturbance_gram(self.design.gram, p))

    def whitened(self, p: Float, disturbance: float = 0.0) -> Float:
        """Rows (Y, N) [windows, 9 or 11, K] whose noise is white at p; the columns a and b, the last two, are projected
        out.

        disturbance: as in pvid.design.weak.design.
        """
        gram = self.covariance(p)
        if disturbance > 0:
            gram = gram + disturbance**2 * self.covariance_of_disturbance(p)
        inverse = np.linalg.inv(np.linalg.cholesky(gram))
        white = self.columns @ inverse.T
        for column in (-2, -1):
            direction = white[:, column]
            length = np.linalg.norm(direction, axis=1, keepdims=True)
            direction = np.divide(direction, length, out=np.zeros_like(direction), where=length > 0)
            white = white - np.einsum("wik,wk->wi", white, direction)[:, :, None] * direction[:, None, :]
        return np.asarray(white[:, :-2])

    def fitted(self, p: Float, disturbance: float = 0.0) -> Fit:
        """The least squares from p on, whitened at the estimate itself; windows with a jolt are left out."""
        kept, begun = np.ones(len(self.columns), np.bool_), p
        for _ in range(_WHITENINGS):
            white = self.whitened(p, disturbance)
            energy = np.sum(_residuals(white, p) ** 2, axis=1)
            kept = energy <= JOLT * np.median(energy)
            p = least_squares(np.einsum("wik,wjk->ij", white[kept], white[kept]), p)
            if _diverges(p, begun):
                break
        return self.judged(p, disturbance, kept)

    def judged(self, p: Float, disturbance: float = 0.0, kept: npt.NDArray[np.bool_] | None = None) -> Fit:
        """Residuals, scores and information of the rows at a given p."""
        white = self.whitened(p, disturbance)
        if kept is not None:
            white = white[kept]
        e, n, c = _residuals(white, p), white[:, 1:], _jacobian(p)
        energy = np.sum(e**2, axis=1)
        freedom = len(white) * (self.design.functions - 2) - len(p)
        return Fit(
            p=p,
            chi2=float(energy.sum()) / max(freedom, 1) / self.row_sd**2,
            information=c.T @ np.einsum("wik,wjk->ij", n, n) @ c,
            scores=np.einsum("wik,wk->wi", n, e) @ c,
            energy=energy,
            signal=np.sum(white[:, 0] ** 2, axis=1),
            row_sd=self.row_sd,
        )


def _residuals(white: Float, p: Float) -> Float:
    """Y - N^T theta(p) [windows, K]."""
    return np.asarray(white[:, 0] - np.einsum("j,wjk->wk", _theta(p), white[:, 1:]))


def _bridged(x: Float, present: npt.NDArray[np.bool_]) -> Float:
    if present.all():
        return x
    at = np.flatnonzero(present)
    if len(at) == 0:
        raise PvidError("the run has no sample that is a number")
    return np.interp(np.arange(len(x)), at, x[at])


def _whole(present: npt.NDArray[np.bool_], design: WeakDesign, windows: int) -> npt.NDArray[np.bool_]:
    """Which windows lack no sample."""
    missing = np.concatenate([[0], np.cumsum(~present)])
    first = design.decimation * design.hop * np.arange(windows)
    last = first + design.taps + design.decimation * (design.window - 1)
    return np.asarray(missing[np.minimum(last, len(present))] == missing[first])


def energy_at(moments: Float, p: Float) -> Float:
    """Sum of squares of Y - N^T theta(p), from the moments of (Y, N) [..., n, n]: [...]."""
    weights = np.empty(moments.shape[-1])
    weights[0], weights[1:] = 1.0, -_theta(p)
    return np.asarray(moments @ weights @ weights)


def least_squares(moments: Float, p: Float) -> Float:
    """Constrained least squares of theta(p) by damped Gauss-Newton steps in (log w, log d1, log d2, c and friction),
    from p on; a search that diverges ends where it is."""
    m, b, begun = moments[1:, 1:], moments[1:, 0], p
    damping, energy = 1e-3, float(energy_at(moments, p))
    units, one = np.ones(len(p)), np.eye(len(p))
    for _ in range(_STEPS):
        units[:_MAPPED] = p[:_MAPPED]
        c = _jacobian(p) * units
        information, force = c.T @ m @ c, c.T @ (b - m @ _theta(p))
        scale = 1 / np.sqrt(np.maximum(information.diagonal(), 1e-300))
        normal = information * (scale[:, None] * scale)
        force = scale * force
        longest, there, better = math.inf, p, False
        while not better and damping < 1e12 and longest >= _DONE:  # a shorter step is below what rounding resolves
            step = scale * np.linalg.solve(normal + damping * one, force)
            step[:_MAPPED] = np.minimum(np.maximum(step[:_MAPPED], -_LONGEST_STEP), _LONGEST_STEP)
            longest = float(np.abs(step[:_MAPPED]).max())
            there = p + step
            there[:_MAPPED] = p[:_MAPPED] * np.exp(step[:_MAPPED])
            now = float(energy_at(moments, there))
            better = math.isfinite(now) and now <= energy
            damping *= 1 / 8 if better else 4
        if not better:
            break
        p, energy = there, now
        if longest < _DONE or _diverges(p, begun):
            break
    return p


def _diverges(p: Float, begun: Float) -> bool:
    far = np.abs(np.log(p[:_MAPPED] / begun[:_MAPPED])).max() > _FAR
    return bool(far) and not MODEL.is_plausible(p)


def _theta(p: Float) -> Float:
    """theta(p), friction last."""
    core = theta(p[:_CORE])
    return core if len(p) <= _CORE else np.concatenate([core, p[_CORE:]])


def _jacobian(p: Float) -> Float:
    """d theta / d p, friction last."""
    core = jacobian(p[:_CORE])
    (rows, columns), friction = core.shape, len(p) - _CORE
    if friction <= 0:
        return core
    out = np.zeros((rows + friction, columns + friction))
    out[:rows, :columns] = core
    out[rows:, columns:] = np.eye(friction)
    return out
