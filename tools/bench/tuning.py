"""What tuning is worth: errors against the truth with the default settings and with those that `tune` picks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from pvid.core.native import Native
from pvid.rig.file import Nominal, RigFile
from pvid.rig.run import Run
from pvid.run.identify import Identification, identify
from pvid.run.tune import Tuned, tune
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Drive,
    Pendulum,
    Tone,
    simulate,
    standard_sensors,
)

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
DURATION_S = 40.0
SEEDS = 6
HEADER = (
    "rig",
    "default: w / d1 / d2 %",
    "tuned: w / d1 / d2 %",
    "tuned over default",
    "window s",
    "functions",
    "decimation",
    "pass band Hz",
    "full angle, friction",
    "forgetting s",
)


@dataclass(frozen=True)
class Case:
    """The standard rig with all lengths times `scale` (times with its root), its drive scaled alike.

    drift : relative change of w over the run; the truth is then w at its end
    friction : of both joints over the mass of body 2 [m^2/s]
    """

    label: str
    scale: float = 1.0
    bits: int = 14
    rate: float = RATE_HZ
    drift: float = 0.0
    friction: float = 0.0

    @property
    def pendulum(self) -> Pendulum:
        """Of the case."""
        one = STANDARD_PENDULUM
        l1, l2, rho2 = (self.scale * x for x in (one.l1, one.l2, one.rho2))
        return Pendulum(l1, l2, rho2, one.g, self.friction, self.friction)

    @property
    def tones(self) -> tuple[Tone, ...]:
        """Of its drive."""
        slower = math.sqrt(self.scale)
        return tuple(Tone(t.amplitude_m * self.scale, t.frequency_hz / slower, t.phase_rad) for t in STANDARD_DRIVE)

    @property
    def rig(self) -> RigFile:
        """What a user would write who knows l1 and the sensors."""
        l1 = self.pendulum.l1
        sensor = replace(RigFile.standard().sensor, phi_lsb=standard_sensors(self.bits).phi_lsb)
        return RigFile(l1=l1, nominal=Nominal(l2=l1 / 3, rho2=l1 / 3), sensor=sensor, sample_rate=self.rate, l1_sd=0.0)

    def run(self, seed: int) -> Run:
        """A run of the full equations; of the linear ones where w drifts."""
        sensors = standard_sensors(self.bits)
        if self.drift == 0.0:
            return simulate(self.pendulum, self.tones, sensors, self.rate, DURATION_S, truth="full", seed=seed).run
        t, phi, y = self._drifting()
        measured_phi, measured_y = sensors.measure(phi, y, seed)
        return Run(t, measured_phi, measured_y, self.rate)

    @property
    def truth(self) -> Float:
        """w, d1, d2 at the end of the run."""
        w, d1, d2 = self.pendulum.linear
        return np.array([w * (1 + self.drift), d1, d2])

    def _drifting(self) -> tuple[Float, Float, Float]:
        """t, phi and y where w changes linearly: phi'' = G q, q'' = -d1 phi'' - d2 G phi with G = w(t) + u."""
        t = np.arange(round(DURATION_S * self.rate)) / self.rate
        drive = Drive(self.tones)
        w, d1, d2 = self.pendulum.linear
        absolute1, absolute2 = STANDARD_RELEASE
        big_l2 = d1 - d2 - 1
        angle = absolute2 - absolute1
        q = absolute1 - (big_l2 + d2) * angle  # phi1 - L2 (1 + L1) phi

        tones = [(tone.amplitude_m, 2 * math.pi * tone.frequency_hz, tone.phase_rad) for tone in self.tones]

        def rate(time: float, state: Float) -> Float:
            u = -sum(a * omega**2 * math.sin(omega * time + phase) for a, omega, phase in tones) / self.pendulum.l1
            g = w * (1 + self.drift * time / DURATION_S) + u
            acceleration = g * state[2]
            return np.array([state[1], acceleration, state[3], -d1 * acceleration - d2 * g * state[0]])

        solution = solve_ivp(rate, (0.0, t[-1]), [angle, 0.0, q, 0.0], "DOP853", t, rtol=1e-9, atol=1e-12)
        return t, solution.y[0], drive.derivatives(t)[:, 0]


CASES = (
    Case("standard"),
    Case("standard, 12 bits", bits=12),
    Case("l1 = 1.2 m, modes half as fast", 4.0),
    Case("l1 = 0.1 m, modes 1.7 times as fast", 1 / 3),
    Case("l1 = 0.05 m, modes 2.4 times as fast", 1 / 6),
    Case("standard, 2 kHz", rate=2000.0),
    Case("standard, w falls by 5 %", drift=-0.05),
    Case("standard, friction 2e-4 m^2/s in both joints", friction=2e-4),
)


@dataclass(frozen=True)
class Outcome:
    """Relative errors of w, d1, d2 [seeds, 3], default (None: some run is not identified) and tuned; the choices."""

    default: Float | None
    tuned: Float
    choices: Sequence[Tuned]

    @property
    def ratio(self) -> float:
        """RMS over everything, tuned over default; NaN where the default identifies nothing."""
        if self.default is None:
            return math.nan
        return float(np.sqrt(np.mean(self.tuned**2) / np.mean(self.default**2)))


def run_case(
    native: Native, case: Case, seeds: Sequence[int] = range(SEEDS), progress: Callable[[], None] = lambda: None
) -> Outcome:
    """Identifies every run with the rig file as it is and with what `tune` makes of it."""
    default: list[Float] = []
    tuned, choices = [], []
    for seed in seeds:
        run = case.run(seed)
        choice = tune(run, case.rig, native)
        choices.append(choice)
        tuned.append(errors(case, identify(run, choice.rig, native)))
        by_default = identify(run, case.rig, native)
        if by_default.identified:
            default.append(errors(case, by_default))
        progress()
    return Outcome(np.array(default) if len(default) == len(tuned) else None, np.array(tuned), choices)


def errors(case: Case, found: Identification) -> Float:
    """Relative errors of w, d1, d2."""
    return np.array([found.value[name] for name in found.model.mapped_names]) / case.truth - 1


def row(case: Case, outcome: Outcome) -> tuple[str, ...]:
    """The outcome as text; of the settings the range."""

    def rms(errors: Float | None) -> str:
        if errors is None:
            return "nothing"
        return " / ".join(f"{100 * value:.2g}" for value in np.sqrt(np.mean(errors**2, axis=0)))

    def span(values: list[float]) -> str:
        low, high = min(values), max(values)
        return f"{low:g}" if low == high else f"{low:g} to {high:g}"

    settings = [choice.rig.identifier for choice in outcome.choices]
    corrected = [sum(getattr(one, name) for one in settings) for name in ("full_angle", "damping")]
    return (
        case.label,
        rms(outcome.default),
        rms(outcome.tuned),
        "-" if outcome.default is None else f"{outcome.ratio:.2f}",
        span([one.window_s for one in settings]),
        span([one.test_functions for one in settings]),
        span([one.decimation for one in settings]),
        span([one.pass_hz for one in settings]),
        f"{corrected[0]}, {corrected[1]} of {len(settings)}",
        span([one.forgetting_s for one in settings]),
    )


STEPS = len(CASES) * SEEDS


def tuning_table(native: Native, progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """One row a case."""
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        progress(done)

    for case in CASES:
        yield row(case, run_case(native, case, progress=advance))
