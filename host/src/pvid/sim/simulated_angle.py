"""The angle that a pendulum with the identified parameters would show, beside the one that was measured.

The run is cut into blocks of about two slow periods. In each the full equations (sines and cosines) are integrated with
the pivot's measured motion, from a start of the block's own (two angles, two rates) that is fitted to the block: the
parameters alone must explain the rest. All blocks, and their sensitivities to the starts, are integrated at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.models.kapitza.modes import modes_hz
from pvid.rig.run import Run
from pvid.sim.pendulum import Pendulum, is_physical

Float = npt.NDArray[np.float64]

_PERIODS = 2.0  # slow ones a block
_STEPS_A_PERIOD = 30.0  # of the fast mode: RK4 is then right to 1e-5 a period
_SMOOTHING_PERIODS = 0.25  # of the fast mode, for the pivot's acceleration: right to 1e-3 at its frequency
_DEGREE = 5
_MOST_BLOCKS = 300
_SWEEPS = 8
_RETRIES = 3
_STUCK = 4.0  # sum of squares over that of the other blocks
_DAMPING = 1e-3  # of the first step
_NUDGE = 1e-6  # rad and rad/s, for sensitivities


@dataclass(frozen=True)
class SimulatedAngle:
    """Measured and simulated angle [n, rad] at times t [n, s], block after block; NaN between blocks that are no
    neighbours, and in those that could not be simulated.

    block_s : length of a block [s];  r2 : 1 less the part of the angle's variance that is not explained;
    rms : of the difference [rad]
    """

    t: Float
    measured: Float
    simulated: Float
    block_s: float
    r2: float
    rms: float

    @property
    def unexplained(self) -> float:
        """Part of the motion, in variance, that is not explained."""
        return 1.0 - self.r2

    @property
    def r2_words(self) -> str:
        """R^2 to the second digit of what it lacks of 1."""
        lacks = min(max(self.unexplained, 1e-9), 1.0)
        return f"{self.r2:.{max(2, 1 - math.floor(math.log10(lacks)))}f}"


def simulated_angle(run: Run, p: Float, l1: float, friction: tuple[float, ...] = ()) -> SimulatedAngle | None:
    """Of a run, at its estimate.

    Parameters
    ----------
    p
        w, d1, d2 and, where it is estimated, the encoder's reading at rest c; else phi is taken to be 0 there.
    l1
        [m]
    friction
        c1, c2 [m^2/s], where they are estimated.

    Returns
    -------
    None where no pendulum has these parameters or the run holds no block.
    """
    if not is_physical(p[:3]):
        return None
    body = Pendulum.from_linear(p[:3], l1)
    slow, fast = modes_hz(p)
    step = 1.0 / (_STEPS_A_PERIOD * fast)
    points = max(math.ceil(_PERIODS / slow / step), 8)  # of a block, with its last
    acceleration = _acceleration(run, fast)
    count = int((run.t[-1] - run.t[0]) / step) // points
    if acceleration is None or count < 1:
        return None
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST_BLOCKS)).astype(int))
    begins = run.t[0] + chosen * points * step
    t = begins[:, None] + step * np.arange(points)
    halves = begins[:, None] + step / 2 * np.arange(2 * points - 1)
    clock = run.t[0] + np.arange(len(run.t)) / run.sample_rate
    finite = np.isfinite(run.phi)
    measured = np.interp(t, clock[finite], run.phi[finite])
    rest = float(p[3]) if len(p) > 3 else 0.0
    pivot = np.interp(halves, clock, acceleration)
    simulated = rest + _fitted(_Motion(body, *friction[:2]), measured - rest, pivot, step)
    simulated[~np.isfinite(simulated).all(axis=1)] = np.nan
    good = np.isfinite(simulated)
    if not good.any():
        return None
    difference = (measured - simulated)[good]
    spread = float(np.var(measured[good]))
    broken = np.append(np.diff(chosen) > 1, False)
    simulated[broken, -1] = np.nan
    return SimulatedAngle(
        t=t.ravel(),
        measured=measured.ravel(),
        simulated=simulated.ravel(),
        block_s=points * step,
        r2=1.0 - float(np.mean(difference**2)) / spread if spread > 0 else 0.0,
        rms=float(np.sqrt(np.mean(difference**2))),
    )


def _acceleration(run: Run, fast: float) -> Float | None:
    """y'' [n, m/s^2]; None where the run is shorter than the smoother."""
    from scipy.signal import savgol_filter

    points = max(_DEGREE + 2, round(_SMOOTHING_PERIODS / fast * run.sample_rate)) | 1
    if len(run.y) < points:
        return None
    finite = np.isfinite(run.y)
    clock = np.arange(len(run.y))
    height = np.interp(clock, clock[finite], run.y[finite])
    return np.asarray(savgol_filter(height, points, _DEGREE, deriv=2, delta=1.0 / run.sample_rate))


@dataclass(frozen=True)
class _Motion:
    """Equations of the pendulum, per unit of body 2's mass, for states [..., 4]: both absolute angles, both rates."""

    body: Pendulum
    c1: float = 0.0
    c2: float = 0.0

    def rates(self, x: Float, acceleration: Float) -> Float:
        l1, l2 = self.body.l1, self.body.l2
        m11, m22 = l1 * l1, l2 * l2 + self.body.rho2**2
        a1, a2, v1, v2 = (x[..., k] for k in range(4))
        gravity = self.body.g + acceleration
        centrifugal = l1 * l2 * np.sin(a1 - a2)
        rubbing = self.c2 * (v2 - v1)
        torque1 = -centrifugal * v2 * v2 - gravity * l1 * np.sin(a1) - self.c1 * v1 + rubbing
        torque2 = centrifugal * v1 * v1 - gravity * l2 * np.sin(a2) - rubbing
        m12 = l1 * l2 * np.cos(a1 - a2)
        det = m11 * m22 - m12 * m12
        return np.stack([v1, v2, (m22 * torque1 - m12 * torque2) / det, (m11 * torque2 - m12 * torque1) / det], axis=-1)

    def angle(self, start: Float, pivot: Float, step: float) -> tuple[Float, Float]:
        """phi [blocks, lanes, points] from starts [blocks, lanes, 4] under the pivot's acceleration at whole and half
        steps [blocks, 2 points - 1], by RK4, and the states at the end [blocks, lanes, 4]."""
        x, points = start, (pivot.shape[1] + 1) // 2
        out = np.empty((*start.shape[:2], points))
        out[..., 0] = x[..., 1] - x[..., 0]
        for k in range(points - 1):
            now, half, then = (pivot[:, 2 * k + i, None] for i in range(3))
            k1 = self.rates(x, now)
            k2 = self.rates(x + step / 2 * k1, half)
            k3 = self.rates(x + step / 2 * k2, half)
            k4 = self.rates(x + step * k3, then)
            x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            out[..., k + 1] = x[..., 1] - x[..., 0]
        return out, x


def _fitted(motion: _Motion, phi: Float, pivot: Float, step: float) -> Float:
    """The angle [blocks, points] from the starts that fit phi [blocks, points] best; searched from rest and, since a
    large swing has minima beside the best one, from where the block before ends."""
    fit, cost, end = _searched(motion, phi, pivot, step, np.zeros((len(phi), 4)))
    for _ in range(_RETRIES):
        stuck = np.flatnonzero(cost > _STUCK * np.median(cost))
        stuck = stuck[stuck > 0]
        if not len(stuck):
            break
        again, cheaper, ends = _searched(motion, phi[stuck], pivot[stuck], step, end[stuck - 1])
        better = cheaper < cost[stuck]
        if not better.any():
            break
        fit[stuck[better]], cost[stuck[better]], end[stuck[better]] = again[better], cheaper[better], ends[better]
    return fit


def _searched(motion: _Motion, phi: Float, pivot: Float, step: float, first: Float) -> tuple[Float, Float, Float]:
    """Levenberg and Marquardt, every block by itself: the angle that fits best [blocks, points], its sum of squares
    [blocks] and the state in which it ends [blocks, 4]."""
    blocks = len(phi)
    start, best, fit = first, np.full(blocks, np.inf), np.full(phi.shape, np.nan)
    tried, damping, end = first, np.full(blocks, _DAMPING), first
    slope, e = np.zeros((*phi.shape, 4)), np.zeros(phi.shape)
    nudges = np.concatenate([np.zeros((1, 4)), _NUDGE * np.eye(4)])
    with np.errstate(all="ignore"):
        for _ in range(_SWEEPS):
            lanes, ends = motion.angle(tried[:, None, :] + nudges, pivot, step)
            cost = ((phi - lanes[:, 0]) ** 2).sum(axis=1)
            better = np.isfinite(lanes).all(axis=(1, 2)) & (cost < best)
            start, best = np.where(better[:, None], tried, start), np.where(better, cost, best)
            fit, end = np.where(better[:, None], lanes[:, 0], fit), np.where(better[:, None], ends[:, 0], end)
            moved = np.moveaxis((lanes[:, 1:] - lanes[:, :1]) / _NUDGE, 1, 2)
            slope = np.where(better[:, None, None], moved, slope)
            e = np.where(better[:, None], phi - lanes[:, 0], e)
            damping = np.clip(damping * np.where(better, 0.1, 10.0), 1e-12, 1e3)
            normal = slope.transpose(0, 2, 1) @ slope
            size = np.diagonal(normal, axis1=1, axis2=2) + 1e-12
            normal = normal + (damping[:, None] * size)[:, :, None] * np.eye(4)
            tried = start + np.linalg.solve(normal, slope.transpose(0, 2, 1) @ e[..., None])[..., 0]
    return fit, best, end
