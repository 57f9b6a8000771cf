"""What tuning is worth: errors against the truth with the default settings and with those that `tune` picks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from pvid.capture import Run
from pvid.errors import PvidError
from pvid.native import Native
from pvid.rig import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Drive,
    Pendulum,
    Tone,
    simulate,
    standard_sensors,
)
from pvid.rigfile import Nominal, RigFile
from pvid.setup import weak_config
from pvid.tune import Tuned, tune

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
    "smoothing ms",
    "forgetting s",
)


@dataclass(frozen=True)
class Case:
    """The standard rig with all lengths times `scale` (times with its root), its drive scaled alike.

    drift : relative change of w over the run; the truth is then w at its end
    """

    label: str
    scale: float = 1.0
    bits: int = 14
    rate: float = RATE_HZ
    drift: float = 0.0

    @property
    def pendulum(self) -> Pendulum:
        """Of the case."""
        one = STANDARD_PENDULUM
        return Pendulum(one.l1 * self.scale, one.l2 * self.scale, one.rho2 * self.scale, one.g)

    @property
    def tones(self) -> tuple[Tone, ...]:
        """Of its drive."""
        slower = math.sqrt(self.scale)
        return tuple(Tone(t.amplitude_m * self.scale, t.frequency_hz / slower, t.phase_rad) for t in STANDARD_DRIVE)

    @property
    def rig(self) -> RigFile:
        """What a user would write who knows l1 and the sensors."""
        l1 = self.pendulum.l1
        sensor = RigFile.standard().sensor
        rig = RigFile(l1=l1, nominal=Nominal(l2=l1 / 3, rho2=l1 / 3), sensor=sensor, sample_rate=self.rate)
        return rig

    def run(self, seed: int) -> Run:
        """A run of the linear pendulum."""
        sensors = standard_sensors(self.bits)
        if self.drift == 0.0:
            return simulate(self.pendulum, self.tones, sensors, self.rate, DURATION_S, seed=seed).run
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

        def rate(time: float, state: Float) -> Float:
            u = drive.derivatives(np.array([time]))[0, 2] / self.pendulum.l1
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
)


@dataclass(frozen=True)
class Outcome:
    """Relative errors of w, d1, d2 [seeds, 3], default (None: refused) and tuned, and the choices."""

    default: Float | None
    tuned: Float
    choices: Sequence[Tuned]

    @property
    def ratio(self) -> float:
        """RMS over everything, tuned over default; NaN where the default is refused."""
        if self.default is None:
            return math.nan
        return float(np.sqrt(np.mean(self.tuned**2) / np.mean(self.default**2)))


def run_case(
    native: Native, case: Case, seeds: Sequence[int] = range(SEEDS), progress: Callable[[], None] = lambda: None
) -> Outcome:
    """Tunes every run and identifies it in the C core, from the rig's nominal."""
    default: list[Float] = []
    tuned, choices = [], []
    for seed in seeds:
        run = case.run(seed)
        choice = tune(run, case.rig, native)
        choices.append(choice)
        tuned.append(errors(native, case, choice.rig, run))
        try:
            default.append(errors(native, case, case.rig, run))
        except PvidError:
            continue
        finally:
            progress()
    return Outcome(np.array(default) if len(default) == len(tuned) else None, np.array(tuned), choices)


def errors(native: Native, case: Case, rig: RigFile, run: Run) -> Float:
    """Relative errors of w, d1, d2 that the C core makes of a run, started at the rig's nominal."""
    identifier = native.weak(weak_config(rig, run.sample_rate))
    identifier.run(run.phi, run.y, sums=False, hashes=False)
    return np.asarray(identifier.assess()["p"][:3].astype(np.float64) / case.truth - 1)


def row(case: Case, outcome: Outcome) -> tuple[str, ...]:
    """The outcome as text; of the settings the range."""

    def rms(errors: Float | None) -> str:
        if errors is None:
            return "refused"
        return " / ".join(f"{100 * value:.2g}" for value in np.sqrt(np.mean(errors**2, axis=0)))

    def span(values: list[float]) -> str:
        low, high = min(values), max(values)
        return f"{low:g}" if low == high else f"{low:g} to {high:g}"

    settings = [choice.chosen.settings for choice in outcome.choices]
    return (
        case.label,
        rms(outcome.default),
        rms(outcome.tuned),
        "-" if outcome.default is None else f"{outcome.ratio:.2f}",
        span([one.window_s for one in settings]),
        span([one.functions for one in settings]),
        span([one.decimation for one in settings]),
        span([1000 * one.smoothing_s for one in settings]),
        span([one.forgetting_s for one in settings]),
    )


def tuning_table(native: Native, progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """One row a case."""
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        progress(done)

    for case in CASES:
        yield row(case, run_case(native, case, progress=advance))
