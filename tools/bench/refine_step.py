"""Both stages of the engine on a mechanism that changes in the middle of a run: how soon each has followed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bench.campaign.motion import accelerations, integrate, relative_angle, step_of
from bench.campaign.pivot import PivotMotion
from bench.refine import engine_of, table_of
from bench.refine_cases import RATE_HZ, RELEASE
from pvid.core.native import Native
from pvid.model.compiled import Following
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM, STANDARD_RELEASE, standard_sensors, standard_start

Float = npt.NDArray[np.float64]

BITS = 14
HEADER = (
    "rad",
    "changed by 20 %",
    "forgetting s",
    "weak form after s",
    "published after s",
    "error at the end %",
    "lost",
)

_NEAR = 0.01  # an estimate that is so near, relative, has followed
_FAST_HZ, _SLIP = 3.0, 1e-3  # of the simulation


@dataclass(frozen=True)
class Change:
    """The standard rig, full equations; 20 s after the start `what`, g or l2, becomes a fifth larger.

    Attributes
    ----------
    angle : largest at first [rad]
    forgetting_s : of both stages
    """

    angle: float
    what: str = "g"
    forgetting_s: float = 10.0
    at_s: float = 20.0
    duration: float = 60.0


CHANGES = (
    *(Change(angle, what) for angle in (0.1, 0.2, 0.3) for what in ("g", "l2")),
    Change(0.1, forgetting_s=30.0, duration=100.0),
    Change(0.1, forgetting_s=0.0, duration=180.0),
)


@lru_cache(2)
def _truth(change: Change) -> tuple[Float, Float, Float]:
    """The exact angle and pivot, and w, d1, d2 after the change."""
    motion = PivotMotion(np.array([[one.amplitude_m, one.frequency_hz, one.phase_rad] for one in STANDARD_DRIVE]))
    rig = STANDARD_PENDULUM
    later = replace(rig, **{change.what: 1.2 * getattr(rig, change.what)})
    steps, step_s = step_of(rig, _FAST_HZ, motion, (0.0, 0.0), _SLIP, change.duration)
    at = round(change.at_s / step_s)
    drive = accelerations(motion, steps, step_s)
    start = [*(RELEASE[change.angle] * np.array(STANDARD_RELEASE)), 0.0, 0.0]
    before = integrate(Native(), rig, start, drive[: 2 * at + 1], step_s)
    assert before is not None
    after = integrate(Native(), later, before[-1], drive[2 * at :], step_s)
    assert after is not None
    t = np.arange(round(change.duration * RATE_HZ)) / RATE_HZ
    state = np.concatenate([before, after[1:]])
    return relative_angle(state, step_s, t), motion.position(t), np.asarray(later.linear)


@dataclass(frozen=True)
class Followed:
    """Of a run: seconds from the change until the estimates stay within 1 %; inf: they do not.

    Attributes
    ----------
    weak, published : of the weak form, and of what is published
    error : relative, of w, d1, d2 at the end: the largest
    """

    weak: float
    published: float
    error: float


def run_change(change: Change, seed: int, patience_s: float | None = None) -> Followed:
    """One run through both stages; `patience_s` of the gate: as a rig file has it that does not say."""
    exact, pivot, truth = _truth(change)
    phi, y = standard_sensors(BITS).measure(exact, pivot, seed)
    engine = engine_of(BITS)
    window_s = engine.weak.design.hop * engine.weak.design.decimation / RATE_HZ
    following = Following(forgetting_s=change.forgetting_s, outlier_patience_s=patience_s)
    weak = replace(
        engine.weak,
        estimator=replace(engine.weak.estimator, forgetting_s=change.forgetting_s),
        gate=replace(engine.weak.gate, patience_s=following.patience_s(window_s)),
    )
    own = replace(engine, weak=weak)
    identifier = own.identifier(standard_start(seed), forgetting_s=change.forgetting_s)
    found = identifier.run_both(np.stack([y, phi], axis=1))
    of_weak = np.flatnonzero(np.isfinite(found.weak_p[:, 0]))
    latest = of_weak[np.searchsorted(of_weak, np.arange(len(phi)), "right") - 1]
    error = np.abs(found.r[:, :3] / truth - 1).max(axis=1)
    return Followed(
        _after(np.abs(found.weak_p[latest, :3] / truth - 1).max(axis=1), change),
        _after(error, change),
        float(error[-1]),
    )


def _after(error: Float, change: Change) -> float:
    """Seconds from the change until the error stays small."""
    far = np.flatnonzero(~(error < _NEAR))
    if far.size == 0:
        return 0.0
    return float("inf") if far[-1] + 1 == len(error) else (far[-1] + 1) / RATE_HZ - change.at_s


def row_of(change: Change, runs: Sequence[Followed]) -> tuple[str, ...]:
    """Cells as in HEADER: medians, and the worst behind them."""
    weak, published = (np.array([getattr(one, name) for one in runs]) for name in ("weak", "published"))
    return (
        f"{change.angle:g}",
        {"g": "w", "l2": "l2"}[change.what],
        f"{change.forgetting_s:g}" if change.forgetting_s else "none",
        *(f"{np.median(one):.1f}, {one.max():.1f}" if np.isfinite(one).any() else "-" for one in (weak, published)),
        f"{100 * np.median([one.error for one in runs]):.2g}",
        str(int(np.sum(~np.isfinite(published)))),
    )


def step_table(seeds: int, progress: Callable[[], None], changes: Sequence[Change] = CHANGES) -> list[tuple[str, ...]]:
    """A row for each change."""
    return table_of(changes, seeds, progress, run_change, row_of)
