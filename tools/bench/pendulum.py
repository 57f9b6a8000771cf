"""The pendulum through the weak engine in C, float32 and fixed point: errors beside the Cramer-Rao bound."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bench.board_engine import board_of
from pvid.core.native import Native
from pvid.model.compiled import CompiledModel
from pvid.models.kapitza.modes import modes_hz
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.design import WeakDesign
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Core
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    Drive,
    Pendulum,
    Sensors,
    Tone,
    Truth,
    simulate,
    standard_sensors,
    standard_start,
)

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
SEEDS = 80
CORES: tuple[Core, ...] = ("f32", "q31")
NEAR, EARLY_S = 0.01, 4.0
HEADER = (
    "rig",
    "bits",
    "offset, rad",
    "published",
    "w / d1 / d2 %",
    "over the bound",
    "s.e. %",
    "in 2 s.e.",
    "within 1 % after 4 s",
    "last run after, s",
    "fixed point: published",
    "within 1 % after 4 s",
    "fixed point: w / d1 / d2 %",
    "largest ratio to float32",
)


@dataclass(frozen=True)
class Rig:
    """A pendulum with a drive; `zero`: reading of the encoder at rest [rad]."""

    name: str
    pendulum: Pendulum
    drive: tuple[Tone, ...]
    bits: int = 14
    zero: float = 0.0
    truth: Truth = "linear"

    @property
    def sensors(self) -> Sensors:
        """Of its encoder."""
        return replace(standard_sensors(self.bits), phi_zero=self.zero)

    def signals(self, seed: int) -> dict[str, Float]:
        """A run of 40 s."""
        run = simulate(self.pendulum, drive=self.drive, sensors=self.sensors, truth=self.truth, seed=seed).run
        return {"phi": run.phi, "y": run.y}

    def start(self, seed: int) -> Float:
        """Within +-50 %, the offset at 0 [4]."""
        return np.append(self.pendulum.linear * standard_start(seed) / STANDARD_PENDULUM.linear, 0.0)


_SLOW_DRIVE = tuple(
    replace(one, amplitude_m=2 * one.amplitude_m, frequency_hz=one.frequency_hz / 2) for one in STANDARD_DRIVE
)


def _standard(bits: int = 14, zero: float = 0.0, truth: Truth = "linear") -> Rig:
    return Rig("standard", STANDARD_PENDULUM, STANDARD_DRIVE, bits, zero, truth)


# The rigs of the measurements that the engine was designed by, and one that is slower.
RIGS = (
    *map(_standard, (12, 14, 16)),
    *(_standard(zero=zero) for zero in (0.3 * 2 * np.pi / 2**14, 0.02, 0.1)),
    Rig("other tones", STANDARD_PENDULUM, (Tone(8e-3, 0.9, 0.3), Tone(4e-3, 3.1, 1.7), Tone(1.5e-3, 6.2, 4.0))),
    Rig("longer body", Pendulum(l1=0.3, l2=0.2, rho2=0.12, g=9.5), STANDARD_DRIVE),
    Rig(
        "short rod",
        Pendulum(l1=0.2, l2=0.1, rho2=0.07, g=9.81),
        (Tone(5e-3, 1.3, 0.3), Tone(4e-3, 2.9, 1.7), Tone(2e-3, 5.3, 4.0)),
    ),
    Rig("twice as slow", Pendulum(l1=1.2, l2=0.4, rho2=0.4, g=9.5), _SLOW_DRIVE),
    replace(_standard(truth="full"), name="standard, full equations, 0.1 rad"),
)
STEPS = SEEDS * len(RIGS)


@dataclass(frozen=True)
class Errors:
    """Of the runs of a rig in one arithmetic.

    Attributes
    ----------
    relative, se : errors and standard errors of w, d1, d2 over the truth [runs, 3]
    published : runs in which the engine published
    since : time from which on the published w, d1, d2 are within 1 % [s]; inf: never [runs]
    """

    relative: Float
    se: Float
    published: int
    since: Float


def design_for(rig: Rig) -> WeakDesign:
    """That of the shipped rig, with window, decimation and filters in proportion to the period of the slow mode."""
    shipped = simulated_rig("kapitza")
    design = WeakDesign(RATE_HZ, shipped.window_s, **shipped.design)  # type: ignore[arg-type]
    slower = modes_hz(STANDARD_PENDULUM.linear)[0] / modes_hz(rig.pendulum.linear)[0]
    decimation = max(1, round(design.decimation * slower))
    taps, rates = (round(one * decimation / design.decimation) | 1 for one in (design.taps, design.rate_taps))
    return replace(design, window_s=design.window_s * slower, decimation=decimation, taps=taps, rate_taps=rates)


def model_for(rig: Rig, **phi: float) -> CompiledModel:
    """The description with the rod, the encoder (`phi`: more of its keys in a rig file) and a guess 5 % off."""
    body = rig.pendulum
    guess = Pendulum(body.l1, 0.95 * body.l2, 1.05 * body.rho2, 1.05 * body.g).linear
    return MechanismRig(
        "kapitza",
        RATE_HZ,
        known={"l1": body.l1},
        sensor={"phi": {"resolution": rig.sensors.phi_lsb, **phi}},
        nominal=dict(zip(("w", "d1", "d2"), map(float, guess), strict=True)),
    ).compiled()


def errors_of(rig: Rig, seeds: int, core: Core = "f32", progress: Callable[[], object] = lambda: None) -> Errors:
    """40 s at 1 kHz, starts within +-50 %; the settings are made from the first run, of the linear equations."""
    truth = rig.pendulum.linear
    board = board_of(
        model_for(rig), replace(rig, truth="linear").signals(0), design_for(rig), np.append(truth, 0.0), core
    )
    relative, se, published, since = [], [], 0, []
    for seed in range(seeds):
        found = board.answer(rig.signals(seed), rig.start(seed))
        relative.append(found.p[:3] / truth - 1)
        se.append(found.se[:3] / truth)
        published += found.published
        far = np.flatnonzero(np.abs(found.history[:, :3] / truth - 1).max(axis=1) >= NEAR)
        first = int(far[-1]) + 1 if len(far) else 0
        since.append(first / RATE_HZ if first < len(found.history) else np.inf)
        progress()
    return Errors(np.array(relative), np.array(se), published, np.array(since))


def rms(x: Float) -> Float:
    """Over the runs [3], in per cent."""
    return np.asarray(100 * np.sqrt(np.mean(np.square(x), axis=0)))


def row_of(rig: Rig, found: Mapping[Core, Errors]) -> tuple[str, ...]:
    """Cells as in HEADER."""
    own, fixed = found["f32"], found["q31"]
    runs, errors = len(own.relative), rms(own.relative)
    covered = 100 * np.mean(np.abs(own.relative) < 2 * own.se, axis=0)
    bound = 100 * cramer_rao(rig)
    return (
        rig.name,
        str(rig.bits),
        f"{rig.zero:.2g}",
        f"{own.published}/{runs}",
        _three(errors),
        " / ".join(f"{one:.2f}" for one in errors / bound) if rig.truth == "linear" else "-",
        _three(100 * np.median(own.se, axis=0)),
        "/".join(f"{one:.0f}" for one in covered),
        f"{np.sum(own.since <= EARLY_S)}/{runs}",
        f"{own.since.max():.1f}",
        f"{fixed.published}/{runs}",
        f"{np.sum(fixed.since <= EARLY_S)}/{runs}",
        _three(rms(fixed.relative)),
        f"{np.max(rms(fixed.relative) / errors):.3f}",
    )


def _three(values: Float) -> str:
    return " / ".join(f"{one:.3g}" for one in values)


def pendulum_table(
    _native: Native, progress: Callable[[int], None] = lambda _: None, seeds: int = SEEDS
) -> Iterator[tuple[str, ...]]:
    """A row for each rig."""
    done = iter(range(1, seeds * len(RIGS) + 1))
    for rig in RIGS:
        floating = errors_of(rig, seeds, "f32", lambda: progress(next(done)))
        yield row_of(rig, {"f32": floating, "q31": errors_of(rig, seeds, "q31")})


def cramer_rao(rig: Rig) -> Float:
    """Smallest possible relative standard deviation of w, d1, d2 from the angle of a run, offset unknown [3].

    u exactly known, the four initial states and the offset unknown too; noise is rounding plus half an LSB, white.
    """
    return np.asarray(rig.sensors.phi_sd * _unit_bound(rig.pendulum, rig.drive))


@lru_cache(maxsize=8)
def _unit_bound(pendulum: Pendulum, tones: tuple[Tone, ...]) -> Float:
    """cramer_rao for a noise of 1 rad."""
    truth = pendulum.linear
    simulation = simulate(pendulum, drive=tones, truth="linear")
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
    times = np.arange(2 * ticks - 1) / RATE_HZ / 2  # RK4 wants the middle of each step too
    drive = Drive(tones).derivatives(times)[:, 2] / pendulum.l1
    angles = _linear_angles(drive, np.array(lanes_p).T, np.array(lanes_x).T)
    slopes = [(angles[:, 2 * k] - angles[:, 2 * k + 1]) / (2 * step) for k in range(3)]
    sensitivities = np.stack([*slopes, *angles[:, 6:].T, np.ones(ticks)])
    scale = 1 / np.linalg.norm(sensitivities, axis=1)
    fisher = (sensitivities * scale[:, None]) @ (sensitivities * scale[:, None]).T
    covariance = np.linalg.inv(fisher) * np.outer(scale, scale)
    return np.asarray(np.sqrt(np.diag(covariance)[:3]))


def _linear_angles(u: Float, p: Float, x: Float) -> Float:
    """phi [ticks, lanes] of phi'' = G q, q'' = -d1 G q - d2 G phi by RK4.

    Parameters
    ----------
    u : at every half step [2 ticks - 1]
    p, x : parameters [3, lanes] and states at the start [4, lanes]
    """
    dt = 1 / RATE_HZ
    w, d1, d2 = p

    def rate(state: Float, drive: float) -> Float:
        g = w + drive
        return np.stack([state[1], g * state[2], state[3], -d1 * g * state[2] - d2 * g * state[0]])

    out = [x[0]]
    for now, middle, after in zip(u[:-1:2], u[1::2], u[2::2], strict=True):
        k1 = rate(x, now)
        k2 = rate(x + dt / 2 * k1, middle)
        k3 = rate(x + dt / 2 * k2, middle)
        k4 = rate(x + dt * k3, after)
        x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append(x[0])
    return np.array(out)
