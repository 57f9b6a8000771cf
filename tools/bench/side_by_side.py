"""Every method on the same data: strong form, weak form, extended Kalman filter, offline output error."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.board_engine import board_of
from bench.pendulum import RIGS, design_for, model_for
from bench.references import KalmanSettings, kalman, output_error, smoothed_drive
from bench.strong_pendulum import identify
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.models.kapitza.physical import physical
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import batch
from pvid.rig.file import Identifier as Settings
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.setup.weak import for_engine
from pvid.sim.pendulum import STANDARD_PENDULUM, Sensors, is_physical, simulate, standard_sensors, standard_start

Float = npt.NDArray[np.float64]

# phi [rad], y [m], sample rate [Hz], start (w, d1, d2) -> p and its standard errors, 3 entries each
Identifier = Callable[[Float, Float, float, Float], tuple[Float, Float]]

SEEDS = 20
RATE_HZ = 1000.0
TRUTH = STANDARD_PENDULUM.linear
HEADER = (
    "method",
    "start off",
    "w %",
    "d1 %",
    "d2 %",
    "l2 %",
    "rho2 %",
    "runs within 1 %",
    "in 2 s.e. %",
    "instructions a sample",
)
# What the filter may believe of its own equations, (rate_noise, wander); the best of them for the case, by the truth,
# is shown: the filter at its best.
BELIEFS = tuple((rate_noise, wander) for rate_noise in (1e-11, 1e-10) for wander in (0.0, 1e-12, 1e-11))


@dataclass(frozen=True)
class Outcome:
    """Relative errors of w, d1, d2 and their relative standard errors, [seeds, 3]; NaN where a method failed."""

    errors: Float
    standard_errors: Float

    @property
    def rms(self) -> Float:
        """Over seeds, [3]; NaN when any failed."""
        return np.asarray(np.sqrt(np.mean(np.square(self.errors), axis=0)))

    @property
    def covered(self) -> Float:
        """Share of the truths within 2 standard errors, [3]."""
        return np.asarray(np.mean(np.abs(self.errors) < 2 * self.standard_errors, axis=0))

    @property
    def near(self) -> int:
        """Runs that end with w, d1 and d2 within 1 %."""
        return int((np.abs(self.errors) < 0.01).all(axis=1).sum())

    @property
    def lengths(self) -> Float:
        """RMS relative error of l2 and rho2, [2]; NaN when a p is that of no pendulum."""
        lengths = physical(TRUTH * (1 + self.errors), STANDARD_PENDULUM.l1)[:, 1:]
        relative = lengths / [STANDARD_PENDULUM.l2, STANDARD_PENDULUM.rho2] - 1
        return np.asarray(np.sqrt(np.mean(np.square(relative), axis=0)))


def accuracy(
    identifier: Identifier,
    sensors: Sensors,
    seeds: int = SEEDS,
    start: Callable[[int], Float] = standard_start,
) -> Outcome:
    """Standard runs of the linear truth through any identifier, starts within +-50 % unless `start` says else."""
    errors, standard_errors = np.full((seeds, 3), np.nan), np.full((seeds, 3), np.nan)
    for seed in range(seeds):
        run = simulate(sensors=sensors, sample_rate=RATE_HZ, seed=seed).run
        try:
            p, se = identifier(run.phi, run.y, RATE_HZ, start(seed))
        except PvidError:
            continue
        errors[seed], standard_errors[seed] = p[:3] / TRUTH - 1, se[:3] / TRUTH
    return Outcome(errors, standard_errors)


def start_off(size: float) -> Callable[[int], Float]:
    """Starts with every parameter off by `size`, signs at random but such that the start is a pendulum."""

    def start(seed: int) -> Float:
        random = np.random.default_rng([seed, 2])
        while True:
            p = np.asarray(TRUTH * (1 + size * np.sign(random.uniform(-1, 1, 3))))
            if is_physical(p):
                return p

    return start


def through_strong(native: Native, **settings: object) -> Identifier:
    """The strong form with the given settings of the rig file's table [identifier], as `pvid identify` runs it from a
    start."""

    def run_core(phi: Float, y: Float, sample_rate: float, start: Float) -> tuple[Float, Float]:
        rig = RigFile.standard()
        chosen: Settings = replace(rig.identifier, form="strong", **settings)  # type: ignore[arg-type]
        # without the pivot sensor's resolution the strong form refuses no row: it is shown at its best
        rig = replace(rig, identifier=chosen, sensor=replace(rig.sensor, y_lsb=0.0))
        run = Run(np.arange(len(phi)) / sample_rate, phi, y, sample_rate)
        result = identify(run, rig, native, start=start)
        names = ("w", "d1", "d2")
        return np.array([result.value[n] for n in names]), np.array([result.se[n] for n in names])

    return run_core


def through_engine(bits: int) -> Identifier:
    """The weak engine in float32 with settings for the standard rig; an error where it publishes nothing."""
    rig = replace(RIGS[0], bits=bits)
    board = board_of(model_for(rig), rig.signals(0), design_for(rig), np.append(TRUTH, 0.0), "f32")

    def run_engine(phi: Float, y: Float, _sample_rate: float, start: Float) -> tuple[Float, Float]:
        found = board.answer({"phi": phi, "y": y}, np.append(start, 0.0))
        if not found.published:
            raise PvidError(f"the engine publishes nothing: {found.last.text}")
        return found.p[:3], found.se[:3]

    return run_engine


def through_oracle(bits: int) -> Identifier:
    """The weak form in float64, with the engine's design."""
    rig = replace(RIGS[0], bits=bits)
    model, design = ready(model_for(rig)), for_engine(design_for(rig))

    def run_oracle(phi: Float, y: Float, _sample_rate: float, start: Float) -> tuple[Float, Float]:
        fit = batch(WeakRows.of(model, {"phi": phi, "y": y}, design), np.append(start, 0.0), equation_error=False)
        return fit.p[:3], uncertainty(fit).se[:3]

    return run_oracle


def fitted(phi: Float, y: Float, sample_rate: float, start: Float) -> tuple[Float, Float]:
    """Output error from the given start."""
    return output_error(phi, y, sample_rate, start, STANDARD_PENDULUM.l1)


def refined(first: Identifier) -> Identifier:
    """Output error from the answer of another method: from 1 % off it locks to a neighbouring minimum."""

    def run_both(phi: Float, y: Float, sample_rate: float, start: Float) -> tuple[Float, Float]:
        p, _ = first(phi, y, sample_rate, start)
        return fitted(phi, y, sample_rate, p)

    return run_both


def filtered(
    sensors: Sensors, size: float, seeds: int = SEEDS, beliefs: Sequence[tuple[float, float]] = BELIEFS
) -> Outcome:
    """The extended Kalman filter, all seeds at once, starts off by `size`; the best of `beliefs`."""
    drives, angles = [], []
    for seed in range(seeds):
        run = simulate(sensors=sensors, sample_rate=RATE_HZ, seed=seed).run
        u, where = smoothed_drive(run.y, RATE_HZ, STANDARD_PENDULUM.l1)
        drives.append(u)
        angles.append(run.phi[where])
    starts = np.array([start_off(size)(seed) for seed in range(seeds)])
    u, phi = np.array(drives).T, np.array(angles).T
    outcomes = []
    for rate_noise, wander in beliefs:
        p, se = kalman(u, phi, 1 / RATE_HZ, starts, KalmanSettings(sensors.phi_sd, size, rate_noise, wander))
        outcomes.append(Outcome(p / TRUTH - 1, se / TRUTH))
    return min(outcomes, key=lambda outcome: (-outcome.near, float(np.nan_to_num(outcome.rms, nan=np.inf).max())))


def row(method: str, start: str, outcome: Outcome, instructions: int | None) -> tuple[str, ...]:
    """A row of the table, RMS in per cent."""

    def percent(value: float) -> str:
        if not np.isfinite(value):
            return "-"
        return f"{100 * value:.2g}" if value < 1 else ">100"

    return (
        method,
        start,
        *(percent(value) for value in (*outcome.rms, *outcome.lengths)),
        f"{outcome.near}/{len(outcome.errors)}",
        "/".join(f"{100 * share:.0f}" for share in outcome.covered),
        "-" if instructions is None else str(instructions),
    )


def side_by_side(
    native: Native,
    bits: int = 14,
    seeds: int = SEEDS,
    instructions: Mapping[str, int] | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Iterator[tuple[str, ...]]:
    """All methods on the standard rig with an encoder of `bits`.

    Parameters
    ----------
    instructions
        Cost of a sample by stage of bench.cost ("tick", "smoothing", "weak", "kalman"), for the methods that a
        device can run.
    """
    cost = instructions or {}
    sensors = standard_sensors(bits)
    savitzky_golay = through_strong(native, window_s=0.315, degree=10, block=9)
    differences = through_strong(native, differentiator="finite-difference", stride=40)
    weak = through_engine(bits)
    half = "+-50 %"
    jobs: list[tuple[str, str, Callable[[], Outcome], str]] = [
        ("strong form, finite differences 40 ms apart", half, lambda: accuracy(differences, sensors, seeds), "tick"),
        (
            "strong form, Savitzky-Golay 315 ms in blocks of nine, degree 10",
            half,
            lambda: accuracy(savitzky_golay, sensors, seeds),
            "smoothing",
        ),
        ("weak form, C core, float32", half, lambda: accuracy(weak, sensors, seeds), "weak"),
        ("weak form, numpy, float64", half, lambda: accuracy(through_oracle(bits), sensors, seeds), ""),
        ("extended Kalman filter, 7 states", "5 %", lambda: filtered(sensors, 0.05, seeds), "kalman"),
        ("extended Kalman filter, 7 states", "20 %", lambda: filtered(sensors, 0.20, seeds), "kalman"),
        ("offline output error (scipy)", "1 %", lambda: accuracy(fitted, sensors, seeds, start_off(0.01)), ""),
        ("offline output error (scipy)", "weak form's answer", lambda: accuracy(refined(weak), sensors, seeds), ""),
    ]
    for done, (method, start, outcome, stage) in enumerate(jobs):
        progress(done)
        yield row(method, start, outcome(), cost.get(stage))


NUMBER_OF_ROWS = 8
