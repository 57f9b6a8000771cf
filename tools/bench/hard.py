"""Where it gets hard: noise until the answer fails, little motion, little drive, one mode, friction, large angles.

Every run has an unknown encoder offset of 0.02 rad. The engine runs as on a board: its settings are made once for the
encoder, its own trust alone judges. What must not happen is a published answer that is far from the truth by its own
standard errors and raises no alarm, more often than chance explains.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import stats

from bench.board_engine import Answer, FixedBoard, FloatBoard, board_of
from bench.pendulum import RIGS, design_for, model_for
from pvid.configuration.weak import neglected_part
from pvid.core.native import Native
from pvid.rig.run import Run
from pvid.settings.enums import Core
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Sensors,
    Tone,
    Truth,
    simulate,
    standard_sensors,
    standard_start,
)

Float = npt.NDArray[np.float64]

SEEDS = 40
RATE_HZ = 1000.0
ZERO = 0.02  # rad, what the encoder reads at rest
LARGEST = 0.107  # rad, |phi| of the standard rig (linear equations 0.106, full ones 0.108)
TRUTH = STANDARD_PENDULUM.linear
HEADER = (
    "case",
    "published",
    "w %",
    "d1 %",
    "d2 %",
    "s.e. of w %",
    "in 3 s.e. %",
    "alarm",
    "wrong, no alarm",
    "else held",
    "fixed point: published",
    "fixed point: wrong, no alarm",
    "by chance",
    "fault",
)
NOISE_LSB = 0.5  # of an encoder that nothing else is known of
RARE = 1e-3  # probability below which chance is no explanation


@dataclass(frozen=True)
class Case:
    """One row: the standard rig but for what is said.

    Attributes
    ----------
    label : in words
    bits, noise_lsb : of the encoder
    told : whether the rig file gives this noise; otherwise it has NOISE_LSB
    drive : factor on the amplitude of the tones
    tones : of the pivot, before that factor
    release : absolute angles at the start [rad]
    damping : viscous friction of both joints [m^2/s]
    truth : equations of motion
    """

    label: str
    bits: int = 14
    noise_lsb: float = NOISE_LSB
    told: bool = True
    drive: float = 1.0
    tones: tuple[Tone, ...] = STANDARD_DRIVE
    release: tuple[float, float] = STANDARD_RELEASE
    damping: float = 0.0
    truth: Truth = "linear"

    @property
    def sensors(self) -> Sensors:
        """With the zero."""
        return replace(standard_sensors(self.bits), phi_noise_lsb=self.noise_lsb, phi_zero=ZERO)

    def board(self, core: Core = "f32") -> FloatBoard | FixedBoard:
        """The engine with the settings for this encoder."""
        noise = self.noise_lsb if self.told else NOISE_LSB
        return _board(self.bits, noise, core, self.neglected)

    @property
    def neglected(self) -> float:
        """As a recording of the rig gives it; 0 where its equations are linear."""
        return 0.0 if self.truth == "linear" else _neglected(replace(self, bits=14, noise_lsb=NOISE_LSB))

    def run(self, seed: int, duration: float = 40.0) -> Run:
        """What the sensors see in `duration` [s]; both cores get the same."""
        return _run(self, seed, duration)


@lru_cache(maxsize=SEEDS)
def _run(case: Case, seed: int, duration: float) -> Run:
    pendulum = replace(STANDARD_PENDULUM, damping1=case.damping, damping2=case.damping)
    tones = tuple(replace(tone, amplitude_m=case.drive * tone.amplitude_m) for tone in case.tones if case.drive)
    return simulate(pendulum, tones, case.sensors, RATE_HZ, duration, case.release, case.truth, seed).run


def modes() -> Float:
    """Release angles (phi1, phi1 + phi) of the slow and the fast mode with phi = 1 rad, [2, 2]."""
    w, d1, d2 = TRUTH
    big_l2 = d1 - d2 - 1
    stiffness = w * np.array([[1, -big_l2], [-1, big_l2 + d2]])  # of (phi1, phi), theory.md (1)
    squares, shapes = np.linalg.eig(stiffness)
    shapes = shapes[:, np.argsort(squares)]
    return np.asarray([[shape[0] / shape[1], shape[0] / shape[1] + 1] for shape in shapes.T])


def _released(factor: float) -> tuple[float, float]:
    return factor * STANDARD_RELEASE[0], factor * STANDARD_RELEASE[1]


def _in_mode(which: int, phi: float) -> tuple[float, float]:
    a1, a2 = phi * modes()[which]
    return float(a1), float(a2)


def _cases() -> Iterator[Case]:
    for bits in range(14, 7, -1):
        yield Case(f"encoder of {bits} bits", bits=bits)
    for noise in (1, 2, 4, 8, 16, 32, 64, 128, 256, 512):
        yield Case(f"14 bits, noise of {noise} LSB", noise_lsb=noise)
    yield Case("14 bits, noise of 64 LSB, phi_lsb set for 0.58", noise_lsb=64, told=False)
    for bits, factors in ((14, (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005)), (12, (0.2, 0.1, 0.05))):
        for factor in factors:
            largest = LARGEST * factor / standard_sensors(bits).phi_lsb
            shown = f"{largest:.0f}" if largest > 10 else f"{largest:.1f}"
            label = f"start x{factor:g}, angle up to {shown} LSB, {bits} bits"
            yield Case(label, release=_released(factor), bits=bits)
    for bits in (14, 12):
        for factor in (0.3, 0.1, 0.03, 0.01):
            yield Case(f"drive x{factor:g}, {bits} bits", drive=factor, bits=bits)
    yield Case("no drive, free swing", drive=0.0)
    yield Case("no drive, no motion", drive=0.0, release=(0.0, 0.0))
    yield Case("drive, no motion", release=(0.0, 0.0))
    slow, fast = _in_mode(0, 0.08), _in_mode(1, 0.05)
    for bits in (16, 14, 12):
        yield Case(f"slow mode only, one tone, {bits} bits", tones=(Tone(6e-3, 1.1, 0.3),), release=slow, bits=bits)
        yield Case(f"slow mode only, {bits} bits", release=slow, bits=bits)
        yield Case(f"fast mode only, {bits} bits", release=fast, bits=bits)
    for damping in (3e-6, 1e-5, 3e-5, 1e-4, 3e-4):
        yield Case(f"friction of {damping:g} m^2/s, 14 bits", damping=damping)
    yield Case("friction of 0.0001 m^2/s, 12 bits", damping=1e-4, bits=12)
    for factor in (0.25, 0.5, 1.0):
        yield Case(f"full equations, {LARGEST * factor:.3f} rad, 14 bits", release=_released(factor), truth="full")
    for factor in (0.5, 1.0):
        yield Case(
            f"full equations, {LARGEST * factor:.3f} rad, 12 bits", release=_released(factor), truth="full", bits=12
        )


CASES = tuple(_cases())


@lru_cache(maxsize=4)
def _board(bits: int, noise_lsb: float, core: Core, neglected: float) -> FloatBoard | FixedBoard:
    """From a run of the standard rig with the encoder's resolution."""
    rig = replace(RIGS[0], bits=bits, zero=ZERO)
    model, p = model_for(rig, noise=noise_lsb), np.append(TRUTH, ZERO)
    return board_of(model, rig.signals(0), design_for(rig), p, core, neglected)


@lru_cache(maxsize=4)
def _neglected(case: Case) -> float:
    run = case.run(0)
    return neglected_part(model_for(RIGS[0]), {"phi": run.phi, "y": run.y})


@dataclass(frozen=True)
class Outcome:
    """What became of the runs of a case.

    Attributes
    ----------
    published, alarmed : [seeds]
    errors, standard_errors : of w, d1, d2, relative to the truth [seeds, 3], published or not
    correlation : of these errors as published [seeds, 3, 3]
    held : reason of the runs that were not published
    """

    published: npt.NDArray[np.bool_]
    alarmed: npt.NDArray[np.bool_]
    errors: Float
    standard_errors: Float
    correlation: Float
    held: tuple[str, ...]

    @property
    def covered(self) -> npt.NDArray[np.bool_]:
        """Truths within 3 standard errors, [seeds, 3]."""
        return np.asarray(np.abs(self.errors) <= 3 * self.standard_errors)

    @property
    def wrong(self) -> int:
        """Runs that publish, raise no alarm, and have w, d1 or d2 beyond 3 standard errors."""
        return int((self.silent & ~self.covered.all(axis=1)).sum())

    @property
    def silent(self) -> npt.NDArray[np.bool_]:
        """Runs that publish and raise no alarm [seeds]."""
        return self.published & ~self.alarmed

    @property
    def chance(self) -> float:
        """Probability that normal errors with the published covariance put w, d1 or d2 beyond 3 standard errors."""
        if not self.silent.any():
            return 0.0
        normal = stats.multivariate_normal(
            cov=np.median(self.correlation[self.silent], axis=0), allow_singular=True, seed=0
        )
        return 1.0 - float(normal.cdf(np.full(3, 3.0), lower_limit=np.full(3, -3.0)))

    @property
    def fault(self) -> str:
        """What chance does not explain of the runs without alarm, or nothing.

        The number of wrong ones, or a mean error: each would be reported in one of 1000 rows without a fault.
        """
        runs = int(self.silent.sum())
        if not runs:
            return ""
        if stats.binom.sf(self.wrong - 1, runs, self.chance) < RARE:
            return "wrong"
        mean = np.mean((self.errors / self.standard_errors)[self.silent], axis=0)
        beyond = 3 * 2 * stats.norm.sf(np.abs(mean).max() * np.sqrt(runs))  # of three parameters, either sign
        return "biased" if beyond < RARE else ""


def answer_of(case: Case, seed: int, core: Core = "f32") -> Answer:
    """A run of a case, from a start within +-50 %."""
    run = case.run(seed)
    return case.board(core).answer({"phi": run.phi, "y": run.y}, np.append(standard_start(seed), 0.0))


def run_case(
    case: Case, seeds: int = SEEDS, core: Core = "f32", progress: Callable[[int], None] = lambda _: None
) -> Outcome:
    """All seeds of a case; progress is told the runs done."""
    found: list[Answer] = []
    for seed in range(seeds):
        progress(seed)
        found.append(answer_of(case, seed, core))
    return Outcome(
        published=np.array([one.published for one in found]),
        alarmed=np.array([one.alarm for one in found]),
        errors=np.array([one.p[:3] for one in found]) / TRUTH - 1,
        standard_errors=np.array([one.se[:3] for one in found]) / TRUTH,
        correlation=np.array([one.correlation[:3, :3] for one in found]),
        held=tuple(one.last.text for one in found if not one.published),
    )


def row(case: Case, outcome: Outcome, fixed: Outcome) -> tuple[str, ...]:
    """The outcomes in float32 and in fixed point as text.

    RMS errors, median standard error and coverage are those of the published runs in float32.
    """
    shown = outcome.published
    runs = len(shown)
    figures = ["-"] * 5
    if shown.any():
        rms = 100 * np.sqrt(np.mean(np.square(outcome.errors[shown]), axis=0))
        middle = 100 * float(np.median(outcome.standard_errors[shown, 0]))
        covered = 100 * outcome.covered[shown].mean(axis=0)
        figures = [*(f"{value:.2g}" for value in (*rms, middle)), "/".join(f"{share:.0f}" for share in covered)]
    reasons = Counter(outcome.held).most_common(1)
    return (
        case.label,
        f"{shown.sum()}/{runs}",
        *figures,
        f"{(shown & outcome.alarmed).sum()}/{shown.sum()}" if shown.any() else "-",
        str(outcome.wrong),
        reasons[0][0] if reasons else "",
        f"{fixed.published.sum()}/{runs}",
        str(fixed.wrong),
        f"{outcome.silent.sum() * outcome.chance:.2f}" if outcome.silent.any() else "-",
        ", ".join(f"{core}: {one.fault}" for core, one in (("f32", outcome), ("q31", fixed)) if one.fault),
    )


STEPS = len(CASES) * SEEDS


def hard_table(
    _native: Native, seeds: int = SEEDS, progress: Callable[[int], None] = lambda _: None
) -> Iterator[tuple[str, ...]]:
    """All rows; progress is told the runs done."""
    for place, case in enumerate(CASES):

        def advance(done: int, before: int = place * seeds) -> None:
            progress(before + done)

        yield row(case, run_case(case, seeds, "f32", advance), run_case(case, seeds, "q31"))
