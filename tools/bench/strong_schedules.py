"""What the schedules of the strong form change: final p of each against that of all sums at every row, on one run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.tick_methods import VARIANTS, Variant
from pvid.core.native import Native
from pvid.rig.file import Differentiator, RigFile
from pvid.settings.f32 import StrongConfig
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors, standard_start

Float = npt.NDArray[np.float64]

SEEDS = 40
BITS = 20
HEADER = ("differentiator", "schedule", "w %", "d1 %", "d2 %", "largest share of the error")


@dataclass(frozen=True)
class Sampling:
    """Of the standard rig: a rate, a length and the filters."""

    label: str
    rate: float
    duration: float
    differentiator: Differentiator


SAMPLINGS = (
    Sampling("five points, 50 Hz", 50.0, 100.0, "finite-difference"),
    Sampling("Savitzky-Golay 241 ms, 1 kHz", 1000.0, 40.0, "savitzky-golay"),
)


def errors(native: Native, sampling: Sampling, seeds: int = SEEDS) -> dict[Variant, Float]:
    """Relative errors of the final p of each schedule [seeds, 3]; each seed has its own start and noise."""
    found: dict[Variant, list[Float]] = {one: [] for one in VARIANTS}
    sensors = replace(standard_sensors(BITS), random_offset=False)
    for seed in range(seeds):
        run = simulate(
            sensors=sensors, truth="linear", sample_rate=sampling.rate, duration=sampling.duration, seed=seed
        ).run
        config = _config(sampling, seed)
        for variant, own in found.items():
            record = native.identifier(variant.of(config)).run(run.phi, run.y, sums=False, hashes=False)
            own.append(record.p[-1].astype(np.float64) / STANDARD_PENDULUM.linear - 1)
    return {variant: np.array(own) for variant, own in found.items()}


def _config(sampling: Sampling, seed: int) -> StrongConfig:
    rig = RigFile.standard()
    settings = replace(rig.identifier, form="strong", differentiator=sampling.differentiator, stride=1)
    return strong_config(replace(rig, identifier=settings), sampling.rate, standard_start(seed))


def rms(values: Float) -> Float:
    """Over the seeds [3]."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def shares(found: dict[Variant, Float]) -> dict[Variant, Float]:
    """Distance of each schedule from the first, over the error of the first, both rms [3]."""
    exact = found[VARIANTS[0]]
    return {variant: rms(own - exact) / rms(exact) for variant, own in found.items()}


def schedule_rows(
    native: Native, progress: Callable[[int], None] = lambda _: None, seeds: int = SEEDS
) -> Iterator[tuple[str, ...]]:
    """The table: errors of the first schedule, distances of the others from it."""
    for done, sampling in enumerate(SAMPLINGS):
        progress(done)
        found = errors(native, sampling, seeds)
        exact = found[VARIANTS[0]]
        for variant, share in shares(found).items():
            first = variant is VARIANTS[0]
            shown = 100 * rms(exact if first else found[variant] - exact)
            cells = (f"{one:.2g}" for one in shown)
            yield sampling.label, variant.name, *cells, "its error" if first else f"{share.max():.3f}"
