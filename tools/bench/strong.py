"""What encoder the strong form needs: errors by resolution and differentiator, in the C core."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.strong_pendulum import identify
from pvid.core.native import Native
from pvid.rig.file import Differentiator, Identifier, RigFile
from pvid.sim.pendulum import STANDARD_PENDULUM, Truth, simulate, standard_sensors, standard_start

SEEDS = 5
HEADER = ("equations", "encoder", "differentiator", "w %", "d1 %", "d2 %", "standard error of w %")


@dataclass(frozen=True)
class Case:
    """One row: RMS errors over SEEDS runs of the standard rig, starts within +-50 %."""

    truth: Truth
    bits: int
    differentiator: Differentiator
    window_s: float = 0.0
    degree: int = 12
    stride: int = 1

    @property
    def label(self) -> str:
        """The differentiator in words."""
        if self.differentiator == "finite-difference":
            return f"five points {self.stride} ms apart"
        return f"Savitzky-Golay {self.window_s * 1000:.0f} ms, degree {self.degree}"


CASES = (
    *(Case("linear", bits, "savitzky-golay", 0.241, 12) for bits in (14, 16, 18, 20, 22)),
    *(Case("linear", bits, "savitzky-golay", 0.321, 10) for bits in (14, 20)),
    *(Case("linear", 14, "finite-difference", stride=stride) for stride in (10, 20, 40, 80)),
    *(Case("linear", 20, "finite-difference", stride=stride) for stride in (10, 20)),
    Case("full", 20, "savitzky-golay", 0.241, 12),
)


def run_case(native: Native, case: Case) -> tuple[str, ...]:
    """The row of a case, errors in per cent."""
    rig = RigFile.standard()
    settings: Identifier = replace(
        rig.identifier,
        form="strong",
        differentiator=case.differentiator,
        window_s=case.window_s,
        degree=case.degree,
        stride=case.stride,
    )
    # without the pivot sensor's resolution no row is refused: what is shown is what the rows are worth
    rig = replace(rig, identifier=settings, sensor=replace(rig.sensor, y_lsb=0.0))
    errors, predicted = [], []
    for seed in range(SEEDS):
        run = simulate(sensors=standard_sensors(case.bits), truth=case.truth, seed=seed).run
        result = identify(run, rig, native, start=standard_start(seed))
        p = np.array([result.value[name] for name in ("w", "d1", "d2")])
        errors.append(p / STANDARD_PENDULUM.linear - 1)
        predicted.append(result.se["w"] / STANDARD_PENDULUM.linear[0])
    rms = 100 * np.sqrt(np.mean(np.square(errors), axis=0))
    return (
        case.truth,
        f"{case.bits} bits",
        case.label,
        *(f"{value:.2g}" for value in rms),
        f"{100 * float(np.mean(predicted)):.2g}",
    )


STEPS = len(CASES)


def strong_table(native: Native, progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """All rows."""
    for done, case in enumerate(CASES):
        progress(done)
        yield run_case(native, case)
