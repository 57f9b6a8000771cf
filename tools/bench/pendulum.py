"""The pendulum through the weak engine in C float32, beside the pendulum's own weak form: same runs, same starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.codegen.fourier_library import fourier_native
from pvid.codegen.fourier_twin import fourier_model_of
from pvid.core.native import Native
from pvid.models.kapitza.modes import modes_hz
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.fourier.design import FourierDesign
from pvid.oracle.fourier.identify import ready
from pvid.oracle.fourier.rows import WeakRows
from pvid.rig.file import RigFile
from pvid.rig.mechanism_file import MechanismRig
from pvid.run.engine_design import samples_of
from pvid.run.mechanism import model_of
from pvid.settings.fourier import FourierConfig
from pvid.setup.f32 import weak_config
from pvid.setup.fourier import config_of, design_tables, for_engine
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    Pendulum,
    Tone,
    simulate,
    standard_sensors,
    standard_start,
)

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
SEEDS = 80
HEADER = (
    "rig",
    "bits",
    "runs",
    "published",
    "engine: w / d1 / d2 %",
    "s.e. %",
    "in 2 s.e.",
    "own weak form: w / d1 / d2 %",
    "largest ratio",
)


@dataclass(frozen=True)
class Rig:
    """A pendulum with a drive."""

    name: str
    pendulum: Pendulum
    drive: tuple[Tone, ...]
    bits: int = 14


_SLOW_DRIVE = tuple(
    replace(one, amplitude_m=2 * one.amplitude_m, frequency_hz=one.frequency_hz / 2) for one in STANDARD_DRIVE
)

# The rigs of the measurements that the engine was designed by, and one that is slower.
RIGS = (
    *(Rig("standard", STANDARD_PENDULUM, STANDARD_DRIVE, bits) for bits in (12, 14, 16)),
    Rig("other tones", STANDARD_PENDULUM, (Tone(8e-3, 0.9, 0.3), Tone(4e-3, 3.1, 1.7), Tone(1.5e-3, 6.2, 4.0))),
    Rig("longer body", Pendulum(l1=0.3, l2=0.2, rho2=0.12, g=9.5), STANDARD_DRIVE),
    Rig(
        "short rod",
        Pendulum(l1=0.2, l2=0.1, rho2=0.07, g=9.81),
        (Tone(5e-3, 1.3, 0.3), Tone(4e-3, 2.9, 1.7), Tone(2e-3, 5.3, 4.0)),
    ),
    Rig("twice as slow", Pendulum(l1=1.2, l2=0.4, rho2=0.4, g=9.5), _SLOW_DRIVE),
)
STEPS = SEEDS * len(RIGS)


@dataclass(frozen=True)
class Errors:
    """Relative errors and standard errors of w, d1, d2 [runs, 3], and runs in which the engine published."""

    engine: Float
    se: Float
    own: Float
    published: int


def design_for(rig: Rig) -> FourierDesign:
    """That of the shipped rig, with window, decimation and filters in proportion to the period of the slow mode."""
    shipped = simulated_rig("kapitza")
    design = FourierDesign(RATE_HZ, shipped.window_s, **shipped.design)  # type: ignore[arg-type]
    slower = modes_hz(STANDARD_PENDULUM.linear)[0] / modes_hz(rig.pendulum.linear)[0]
    decimation = max(1, round(design.decimation * slower))
    taps, rates = (round(one * decimation / design.decimation) | 1 for one in (design.taps, design.rate_taps))
    return replace(design, window_s=design.window_s * slower, decimation=decimation, taps=taps, rate_taps=rates)


def errors_of(native: Native, rig: Rig, seeds: int, progress: Callable[[], object] | None = None) -> Errors:
    """Linear equations, 40 s at 1 kHz, starts within +-50 %; the tables are those of the first run at the truth."""
    truth = rig.pendulum.linear
    given = {"phi": {"resolution": 2 * np.pi / 2**rig.bits}}
    model = model_of(MechanismRig("kapitza", RATE_HZ, known={"l1": rig.pendulum.l1}, sensor=given))
    made, design = ready(model), for_engine(design_for(rig))
    config: FourierConfig | None = None
    engine, se, own, published = [], [], [], 0
    for seed in range(seeds):
        sensors = standard_sensors(rig.bits)
        run = simulate(rig.pendulum, drive=rig.drive, sensors=sensors, truth="linear", seed=seed).run
        start = truth * standard_start(seed) / STANDARD_PENDULUM.linear
        signals = {"phi": run.phi, "y": run.y}
        if config is None:
            rows = WeakRows.of(made, signals, design)
            tables = design_tables(fourier_model_of(model), rows, np.append(truth, 0.0))
            config = config_of(tables, RATE_HZ, made.parameters)
        begun = np.append(start, 0.0).astype(np.float32)
        core = fourier_native(model, config.design).identifier_of(
            replace(config, estimator=replace(config.estimator, start=begun))
        )
        core.run_samples(samples_of(config, signals), sums=False, hashes=False)
        engine.append(core.estimate["p"][:3].astype(np.float64) / truth - 1)
        se.append(core.estimate["se"][:3] / truth)
        published += core.is_published
        other = native.identifier(weak_config(_own_rig(rig), RATE_HZ, start))
        other.run(run.phi, run.y, sums=False, hashes=False)
        own.append(other.estimate["p"][:3].astype(np.float64) / truth - 1)
        if progress is not None:
            progress()
    return Errors(np.array(engine), np.array(se), np.array(own), published)


def _own_rig(rig: Rig) -> RigFile:
    """For the pendulum's own weak form: lengths within 5 %, as its design needs them; linear, zero unknown."""
    given, body = RigFile.standard(), rig.pendulum
    return replace(
        given,
        l1=body.l1,
        identifier=replace(given.identifier, form="weak", zero=True, full_angle=False),
        sensor=replace(given.sensor, phi_lsb=2 * np.pi / 2**rig.bits),
        nominal=replace(given.nominal, g=1.05 * body.g, l2=0.95 * body.l2, rho2=1.05 * body.rho2),
    )


def rms(x: Float) -> Float:
    """Over the runs [3], in per cent."""
    return np.asarray(100 * np.sqrt(np.mean(np.square(x), axis=0)))


def row_of(rig: Rig, found: Errors) -> tuple[str, ...]:
    """Cells as in HEADER."""
    engine, own = rms(found.engine), rms(found.own)
    covered = 100 * np.mean(np.abs(found.engine) < 2 * found.se, axis=0)
    return (
        rig.name,
        str(rig.bits),
        str(len(found.engine)),
        str(found.published),
        _three(engine),
        _three(100 * np.median(found.se, axis=0)),
        "/".join(f"{one:.0f}" for one in covered),
        _three(own),
        f"{np.max(engine / own):.2f}",
    )


def _three(values: Float) -> str:
    return " / ".join(f"{one:.2g}" for one in values)


def pendulum_table(
    native: Native, progress: Callable[[int], None] = lambda _: None, seeds: int = SEEDS
) -> Iterator[tuple[str, ...]]:
    """A row for each rig."""
    done = iter(range(1, seeds * len(RIGS) + 1))
    for rig in RIGS:
        yield row_of(rig, errors_of(native, rig, seeds, lambda: progress(next(done))))
