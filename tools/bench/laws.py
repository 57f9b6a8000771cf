"""The two laws and their limits, on exact derivatives: theory.md 4, measured in the C core."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.settings.enums import Law
from pvid.settings.f32 import StrongConfig
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_start

STANDARD_SAMPLE_RATE = 1000.0  # Hz

Float = npt.NDArray[np.float64]

RUNS = 40
PRIORS = (1e3, 1e4, 3e4, 1e5, 3e5, 1e6)  # row_sd [rad/s^8]: H0 = (row_sd / start_sd)^2
FEEDBACKS_HZ = (1.1, 3.0, 10.0, 100.0)
START_ERRORS = (0.02, 0.05, 0.10, 0.20, 0.50)


HEADER = (
    "law",
    "setting",
    "start off",
    "< 1 %",
    "< 0.01 %",
    "median error %",
    "worst %",
    "slowest to 1 % [s]",
)


def exact_derivatives() -> tuple[Float, Float]:
    """Exact derivatives of the standard rig: phi [ticks, 5] and u [ticks, 3]."""
    exact = simulate(truth="linear").exact
    assert exact is not None  # the linear truth always has it
    return exact.phi, exact.u


def _settings(start: npt.ArrayLike, **changes: object) -> StrongConfig:
    rig = RigFile.standard()
    rig = replace(rig, identifier=replace(rig.identifier, form="strong", kappa_min=0.0, outlier_gate=0.0))
    config = replace(strong_config(rig, STANDARD_SAMPLE_RATE, start), exact_every=1)
    return replace(config, estimator=replace(config.estimator, **changes))  # type: ignore[arg-type]


def run_law(
    native: Native,
    exact: tuple[Float, Float],
    starts: npt.NDArray[np.float64],
    labels: tuple[str, str, str],
    changes: dict[str, object],
) -> tuple[str, ...]:
    """One row of the table, labelled (law, setting, start), errors in per cent: every start [runs, 3] with the settings
    in `changes`."""
    truth = STANDARD_PENDULUM.linear
    last, settled = [], []
    for one in starts:
        core = native.of_derivatives(_settings(one, **changes))
        record = core.run(*exact, sums=False, hashes=False)
        error = np.abs(record.p / truth - 1).max(axis=1)
        outside = np.flatnonzero(error > 0.01)
        last.append(error[-1])
        settled.append((outside[-1] + 1) / STANDARD_SAMPLE_RATE if len(outside) else 0.0)
    errors = np.array(last)
    good = errors < 0.01
    return (
        *labels,
        f"{good.sum()}/{len(starts)}",
        f"{(errors < 1e-4).sum()}/{len(starts)}",
        f"{100 * np.median(errors):.2g}",
        f"{100 * errors.max():.2g}",
        f"{max(settled):.1f}" if good.all() else "-",
    )


def laws_table(native: Native, progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """All rows: both laws from +-50 %, over priors and feedback rates, then by the size of the start's error."""
    exact = exact_derivatives()
    truth = STANDARD_PENDULUM.linear
    anywhere = np.array([standard_start(seed) for seed in range(RUNS)])
    jobs: list[tuple[npt.NDArray[np.float64], str, str, str, dict[str, object]]] = []
    for row_sd in PRIORS:
        changes: dict[str, object] = {"law": Law.PSEUDOVELOCITY, "row_sd": row_sd}
        jobs.append((anywhere, "pseudovelocity", f"row_sd {row_sd:.0e}", "+-50 %", changes))
    for hz in FEEDBACKS_HZ:
        changes = {"law": Law.STATIONARY, "feedback_hz": hz}
        jobs.append((anywhere, "stationary", f"feedback {hz:g}/s", "+-50 %", changes))
    changes = {"law": Law.STATIONARY, "feedback_hz": 0.0}
    jobs.append((anywhere, "stationary", "Gauss-Newton every tick", "+-50 %", changes))
    for size in START_ERRORS:
        signs = np.sign(np.random.default_rng(0).uniform(-1, 1, (RUNS, 3)))
        # outside the physical region d1 - d2 > 1 a start is no pendulum: such signs are turned round
        starts = truth * (1 + size * signs)
        starts[starts[:, 1] - starts[:, 2] <= 1, 1:] = truth[1:] * (1 + size)
        off = f"{100 * size:g} %"
        jobs.append((starts, "pseudovelocity", "row_sd 1e+05", off, {"law": Law.PSEUDOVELOCITY, "row_sd": 1e5}))
        jobs.append((starts, "stationary", "feedback 10/s", off, {"law": Law.STATIONARY, "feedback_hz": 10.0}))
    for done, (starts, law, setting, off, changes) in enumerate(jobs):
        progress(done)
        yield run_law(native, exact, starts, (law, setting, off), changes)


STEPS = len(PRIORS) + len(FEEDBACKS_HZ) + 1 + 2 * len(START_ERRORS)
