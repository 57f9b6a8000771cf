"""What the weak form is worth with a real encoder: errors beside the Cramer-Rao bound, and are its errors honest?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.setup.f32 import weak_config
from pvid.sim.pendulum import STANDARD_DRIVE as TONES
from pvid.sim.pendulum import STANDARD_PENDULUM, Drive, Truth, simulate, standard_sensors, standard_start

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
HEADER = (
    "case",
    "w %",
    "d1 %",
    "d2 %",
    "l2 %",
    "rho2 %",
    "ratio to the bound in w",
    "published",
    "within 1 % after 4 s",
    "in 2 s.e.",
)


@dataclass(frozen=True)
class Case:
    """One row: the standard rig, `seeds` runs, starts within +-50 %."""

    bits: int
    zero: float = 0.0  # rad, what the encoder reads at rest
    zero_unknown: bool = True
    truth: Truth = "linear"
    seeds: int = 20
    full_angle: bool = False  # the correction
    damping: float = 0.0  # of the plant, both joints [m^2/s]
    friction: bool = False  # estimated

    @property
    def label(self) -> str:
        """The case in words."""
        form = "zero unknown" if self.zero_unknown else "zero taken as 0"
        runs = f", {self.seeds} seeds" if self.seeds != Case.seeds else ""
        plant = f", damping {self.damping:g}" if self.damping else ""
        options = (", full_angle" if self.full_angle else "") + (", damping estimated" if self.friction else "")
        return f"{self.truth} equations{plant}, {self.bits} bits, c = {self.zero:.2g} rad, {form}{options}{runs}"


LSB_14 = 2 * np.pi / 2**14
_CASES = (
    Case(12),
    Case(14),
    Case(16),
    *(Case(14, zero) for zero in (0.3 * LSB_14, 0.02, 0.1)),
    *(Case(14, zero, zero_unknown=False) for zero in (0.0, 0.3 * LSB_14, 0.02)),
    Case(14, truth="full"),
    *(Case(14, zero, truth="full", full_angle=True) for zero in (0.0, 0.02, 0.1)),
    Case(14, truth="full", full_angle=True, damping=1e-4),
    Case(14, truth="full", full_angle=True, damping=1e-4, friction=True),
)
# Twenty draws of the noise are lucky or not by 30 %.
CASES = tuple(replace(case, seeds=80) for case in _CASES)


@dataclass(frozen=True)
class Outcome:
    """Relative errors and standard errors of w, d1, d2 [seeds, 3]; physical errors [seeds, 2] (l2, rho2).

    Of the runs that published nothing it is the start's.
    """

    errors: Float
    standard_errors: Float
    physical: Float
    early: int
    published: int


def run_case(native: Native, case: Case) -> Outcome:
    """All seeds of a case through the C core."""
    rig = RigFile.standard()
    rig = replace(
        rig,
        identifier=replace(
            rig.identifier,
            form="weak",
            zero=case.zero_unknown,
            full_angle=case.full_angle,
            damping=case.friction,
        ),
        sensor=replace(rig.sensor, phi_lsb=2 * np.pi / 2**case.bits),
    )
    truth = STANDARD_PENDULUM.linear
    pendulum = replace(STANDARD_PENDULUM, damping1=case.damping, damping2=case.damping)
    errors, standard_errors, physical, early, published = [], [], [], 0, 0
    for seed in range(case.seeds):
        sensors = replace(standard_sensors(case.bits), phi_zero=case.zero)
        run = simulate(pendulum, sensors=sensors, truth=case.truth, seed=seed).run
        identifier = native.identifier(weak_config(rig, RATE_HZ, standard_start(seed)))
        record = identifier.run(run.phi, run.y, sums=False, hashes=False)
        last = identifier.estimate
        p = last["p"][:3].astype(np.float64)
        errors.append(p / truth - 1)
        standard_errors.append(last["se"][:3] / truth)
        lengths = rig.mechanism.physical(p)[1:]
        physical.append(lengths / [STANDARD_PENDULUM.l2, STANDARD_PENDULUM.rho2] - 1)
        published += identifier.published is not None
        early += bool(np.abs(record.published[4000:, :3] / truth - 1).max() < 0.01)
    return Outcome(np.array(errors), np.array(standard_errors), np.array(physical), early, published)


def row(case: Case, outcome: Outcome) -> tuple[str, ...]:
    """The outcome as text, RMS errors in per cent."""
    rms = 100 * np.sqrt(np.mean(np.square(outcome.errors), axis=0))
    lengths = 100 * np.sqrt(np.mean(np.square(outcome.physical), axis=0))
    covered = (np.abs(outcome.errors) < 2 * outcome.standard_errors).mean(axis=0)
    bound = 100 * cramer_rao(case.bits)[0]
    return (
        case.label,
        *(f"{value:.2g}" for value in (*rms, *lengths)),
        f"{rms[0] / bound:.2f}" if case.truth == "linear" else "-",
        f"{outcome.published}/{case.seeds}",
        f"{outcome.early}/{case.seeds}",
        "/".join(f"{100 * share:.0f}" for share in covered),
    )


STEPS = len(CASES)


def weak_table(native: Native, progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """All rows, and the bound itself."""
    for bits in (12, 14, 16):
        yield (
            f"Cramer-Rao bound, {bits} bits",
            *(f"{100 * value:.2g}" for value in cramer_rao(bits)),
            "-",
            "-",
            "1",
            "-",
            "-",
            "-",
        )
    for done, case in enumerate(CASES):
        progress(done)
        yield row(case, run_case(native, case))


def cramer_rao(bits: int) -> Float:
    """Smallest possible relative standard deviation of w, d1, d2 from the standard run's angle, zero unknown.

    u exactly known, the four initial states and c unknown too; noise is rounding plus half an LSB, white.
    """
    noise = 2 * np.pi / 2**bits * np.sqrt(1 / 12 + 1 / 4)
    return np.asarray(noise * _unit_bound())


@lru_cache(maxsize=1)
def _unit_bound() -> Float:
    """cramer_rao for a noise of 1 rad."""
    truth = STANDARD_PENDULUM.linear
    simulation = simulate(truth="linear")
    ticks = len(simulation.run.t)
    assert simulation.exact is not None
    w, d1, d2 = truth
    phi, u = simulation.exact.phi, simulation.exact.u
    q = phi[:, 2] / (w + u[:, 0])
    q_rate = (phi[:, 3] - u[:, 1] * q) / (w + u[:, 0])
    start = np.array([phi[0, 0], phi[0, 1], q[0], q_rate[0]])
    step = 1e-5
    lanes_p, lanes_x = [], []
    for k in range(3):
        for sign in (1, -1):
            lanes_p.append(truth * np.exp(sign * step * np.eye(3)[k]))
            lanes_x.append(start)
    for k in range(4):
        lanes_p.append(truth)
        lanes_x.append(np.eye(4)[k])
    angles = _linear_angles(np.array(lanes_p).T, np.array(lanes_x).T, ticks)
    slopes = [(angles[:, 2 * k] - angles[:, 2 * k + 1]) / (2 * step) for k in range(3)]
    sensitivities = np.stack([*slopes, *angles[:, 6:].T, np.ones(ticks)])
    scale = 1 / np.linalg.norm(sensitivities, axis=1)
    fisher = (sensitivities * scale[:, None]) @ (sensitivities * scale[:, None]).T
    covariance = np.linalg.inv(fisher) * np.outer(scale, scale)
    return np.asarray(np.sqrt(np.diag(covariance)[:3]))


def _linear_angles(p: Float, x: Float, ticks: int) -> Float:
    """phi [ticks, lanes] of phi'' = G q, q'' = -d1 G q - d2 G phi by RK4, p [3, lanes], x [4, lanes] at the start."""
    dt = 1 / RATE_HZ
    times = np.arange(2 * ticks - 1) * dt / 2  # RK4 wants the middle of each step too
    u = Drive(TONES).derivatives(times)[:, 2] / STANDARD_PENDULUM.l1
    w, d1, d2 = p

    def rate(state: Float, drive: float) -> Float:
        g = w + drive
        return np.stack([state[1], g * state[2], state[3], -d1 * g * state[2] - d2 * g * state[0]])

    out = np.empty((ticks, x.shape[1]))
    for tick in range(ticks):
        out[tick] = x[0]
        if tick == ticks - 1:
            break
        now, middle, after = u[2 * tick : 2 * tick + 3]
        k1 = rate(x, now)
        k2 = rate(x + dt / 2 * k1, middle)
        k3 = rate(x + dt / 2 * k2, middle)
        k4 = rate(x + dt * k3, after)
        x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return out
