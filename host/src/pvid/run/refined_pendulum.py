"""Refinement of the pendulum: full equations, friction of both joints and the skew of the sensors, over a whole run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import LOG_SD
from pvid.design.second_derivative import second_derivative
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak import sample_sd
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.refined import Inputs, Measured, Prior, Problem, Refined, refined
from pvid.run.refined_kernel import kernel_of

Float = npt.NDArray[np.float64]

_PERIODS = 2.0  # of the slow mode in a block
_SEARCH = 0.35  # of that: the first blocks
_EDGE = 3.2  # times the fast mode: the least pass band of the drive
_LEAST_HZ = 5.0
_STEP = 0.1  # of a step times the fast mode's angular frequency
_SD = {"k1": 2.0, "k2": 2.0, "tau": 0.02, "c": 1.0}  # what is known before: little


@dataclass(frozen=True, eq=False)
class RefinedPendulum:
    """Outcome: `found` and the problem that it solves; `first` is the sample of the run that the problem starts at."""

    problem: Problem
    found: Refined
    first: int


def refine_pendulum(run: Run, rig: RigFile, p: Float, c: float) -> RefinedPendulum:
    """Refines an estimate.

    Parameters
    ----------
    p, c : w, d1, d2 and the encoder's reading at rest to start from

    Raises
    ------
    PvidError
        When the run is too short.
    """
    model = compiled_of("kapitza")
    kernel = kernel_of(model)
    made = kernel.made
    mechanism = rig.mechanism.model
    slow, fast = mechanism.modes_hz(p)
    rate = run.sample_rate
    edge = max(_EDGE * fast, _LEAST_HZ, 1.1 * drive_edge_hz(run, rig))
    front = second_derivative(rate, min(edge, 0.4 * rate))
    y = np.interp(np.arange(len(run.y)), np.flatnonzero(np.isfinite(run.y)), run.y[np.isfinite(run.y)])
    times, acceleration = front.apply(y, rate)
    if len(times) < 12:
        raise PvidError(f"the run of {len(run.y) / rate:.3g} s is too short for the refinement")
    first, last = int(np.ceil(times[0] * rate)), int(times[-1] * rate)
    sub = max(1, int(np.ceil(2 * np.pi * fast / rate / _STEP)))
    samples = last - first + 1
    inputs = _inputs(times - first / rate, acceleration / rig.l1, rate, sub, samples)
    sd = sample_sd(rig.sensor.phi_lsb, 0.5)
    measured = Measured(run.phi[first : last + 1, None], np.array([sd]), inputs, rate, sub)
    problem = Problem(kernel, measured)
    values = {"w": p[0], "d1": p[1], "d2": p[2], "c": c, "l1": rig.l1}
    names = [*(one.name for one in made.parameters), *made.settings]
    r = np.array([values.get(name, 0.0) for name in names])
    prior_sd = np.array([3 * LOG_SD if one.log else _SD[one.name] for one in made.parameters])
    prior = Prior(r, prior_sd, np.ones(problem.n, bool))
    block = _PERIODS / slow * rate
    lengths = tuple(max(8, round(share * block)) for share in (_SEARCH, 1.0))
    return RefinedPendulum(problem, refined(problem, prior, lengths), first)


def _inputs(t: Float, u: Float, rate: float, sub: int, samples: int) -> Inputs:
    """u and u' at the steps, of any skew, by a spline of order five through the filtered track."""
    from scipy.interpolate import make_interp_spline  # takes a quarter of a second

    spline = make_interp_spline(t, u, k=5)
    slope = spline.derivative()
    at = np.arange(2 * sub * samples + 1) / (2 * sub * rate)
    kept: dict[float, tuple[Float, Float]] = {}

    def steps(fine: Float) -> Float:
        return np.ascontiguousarray(np.stack([fine[0:-2:2], fine[1:-1:2], fine[2::2]], 1)[..., None])

    def of(skew: float) -> tuple[Float, Float]:
        if skew not in kept:
            if len(kept) > 4:
                kept.pop(next(iter(kept)))
            when = np.clip(at + skew, t[0], t[-1])
            kept[skew] = steps(spline(when)), steps(slope(when))
        return kept[skew]

    return of


def drive_edge_hz(run: Run, rig: RigFile) -> float:
    """Up to where the drive's spectrum stands above its sensor's noise [Hz]."""
    y = run.y[np.isfinite(run.y)]
    n = len(y)
    window = np.hanning(n)
    spectrum = np.abs(np.fft.rfft((y - y.mean()) * window)) ** 2
    noise = rig.sensor.y_lsb**2 * (1 / 12 + rig.sensor.y_noise**2 if hasattr(rig.sensor, "y_noise") else 1 / 4)
    floor = noise * float(np.sum(window**2))
    hz = np.fft.rfftfreq(n, 1 / run.sample_rate)
    weighted = spectrum * hz**4
    total = weighted[spectrum > 30 * floor].sum()
    above = np.flatnonzero((spectrum > 30 * floor) & (weighted > 1e-5 * total))
    return float(hz[above[-1]]) if len(above) else 0.0
