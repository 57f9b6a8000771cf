"""Errors in variables: the bias that the encoder's noise leaves in the weak form, as it is and with it taken off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.hard import CASES as HARD
from bench.hard import RATE_HZ, SEEDS, TRUTH, Case, run_case
from pvid.core.native import Native
from pvid.oracle.weak import WeakOracle, WeakSettings, identify_weak, sample_sd
from pvid.oracle.weak_noise import CompensatedOracle
from pvid.setup.f32 import weak_design_of
from pvid.sim.pendulum import standard_start

Float = npt.NDArray[np.float64]

LABELS = (
    "14 bits, noise of 16 LSB",
    "14 bits, noise of 64 LSB",
    "14 bits, noise of 128 LSB",
    "14 bits, noise of 256 LSB",
    "start x0.01, angle up to 2.8 LSB, 14 bits",
    "encoder of 8 bits",
    "encoder of 12 bits",
    "encoder of 14 bits",
)
CASES = tuple(case for label in LABELS for case in HARD if case.label == label)
HEADER = (
    "case",
    "C core publishes",
    "bias of w/d1/d2 %",
    "compensated %",
    "s.e. of w/d1/d2 %",
    "bias made by the noise, in s.e.",
)


@dataclass(frozen=True)
class Bias:
    """Relative errors and standard errors of w, d1, d2 [seeds, 3], of one estimator."""

    errors: Float
    standard_errors: Float

    @property
    def mean(self) -> Float:
        """[3]."""
        return np.asarray(self.errors.mean(axis=0))

    @property
    def middle(self) -> Float:
        """Median standard error, [3]."""
        return np.asarray(np.median(self.standard_errors, axis=0))


def errors_of(case: Case, seeds: int, estimator: type[WeakOracle]) -> Bias:
    """A case in float64 by `estimator`, which is told the noise; starts within +-50 %, the zero unknown."""
    design = weak_design_of(case.rig, RATE_HZ)
    row_sd = sample_sd(case.sensors.phi_lsb, case.noise_lsb) / np.sqrt(design.decimation)
    errors, standard_errors = np.empty((seeds, 3)), np.empty((seeds, 3))
    for seed in range(seeds):
        run = case.run(seed)
        settings = WeakSettings(np.append(standard_start(seed), 0.0), float(row_sd))
        result = identify_weak(run.phi, run.y, design, settings, estimator)
        errors[seed] = result.last.p[:3] / TRUTH - 1
        standard_errors[seed] = result.sandwich[:3] / TRUTH
    return Bias(errors, standard_errors)


def row(case: Case, published: int, plain: Bias, compensated: Bias) -> tuple[str, ...]:
    """The biases as text."""

    def percent(values: Float) -> str:
        return "/".join(f"{100 * value:.2g}" for value in values)

    return (
        case.label,
        f"{published}/{len(plain.errors)}",
        percent(plain.mean),
        percent(compensated.mean),
        percent(plain.middle),
        "/".join(f"{value:.3f}" for value in made_by_noise(plain, compensated)),
    )


def made_by_noise(plain: Bias, compensated: Bias) -> Float:
    """What the noise inside the rows does to w, d1, d2, in standard errors, [3].

    From differences on the same runs, in which the runs' own errors cancel: known far better than either mean.
    """
    return np.asarray((plain.errors - compensated.errors).mean(axis=0) / plain.middle)


def noise_table(
    native: Native, seeds: int = SEEDS, progress: Callable[[int], None] = lambda _: None
) -> Iterator[tuple[str, ...]]:
    """All rows."""
    for place, case in enumerate(CASES):
        progress(place)
        published = int(run_case(native, case, seeds).published.sum())
        yield row(case, published, *(errors_of(case, seeds, kind) for kind in (WeakOracle, CompensatedOracle)))
