"""The refinement in C with its options, dry friction and a slanted slide: errors, and costs on an emulated board."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from bench.engine import rms
from bench.refine import table_of
from bench.refine_cases import L1, RELEASE
from bench.refine_imperfect import BITS, Fault, Published, run_fault, truth_of
from pvid.board.boards import BOARDS
from pvid.board.refined_image import build_refined_image, published_run
from pvid.board.sizes import REFINED_TICKS, built_engine, measured
from pvid.sim.pendulum import STANDARD_PENDULUM, standard_sensors

HEADER = (
    "rad",
    "rig",
    "options",
    "published",
    "of the time %",
    "first after s",
    "w / d1 / d2 %",
    "in 2 s.e. %",
    "largest ever / s.e.",
    "f1 / f2 %",
    "slant mrad",
    "confidently wrong",
)
COST_HEADER = ("options", "mean", "longest", "state", "stack", "code", "tables")

_DRY, _SLANT = ("dry_friction",), ("slant",)
_BOTH = (*_DRY, *_SLANT)
_BOARD = "mps2-an386"


def _cases(angle: float) -> list[Fault]:
    without = [Fault(angle, slant=slant) for slant in (0.01, 0.03)]
    smooth = [Fault(angle, options=options) for options in (_DRY, _SLANT)]
    frictions = [Fault(angle, dry=dry, options=_DRY) for dry in (1e-4, 3e-4, 1e-3, 3e-3)]
    slants = [Fault(angle, slant=slant, options=_SLANT) for slant in (0.01, 0.03, 0.1)]
    return [*smooth, *frictions, *without, *slants, Fault(angle, dry=3e-4, slant=0.03, options=_BOTH)]


CASES = tuple(case for angle in RELEASE for case in _cases(angle))


def _of_options(fault: Fault, runs: Sequence[Published]) -> tuple[str, str]:
    """RMS errors of the frictions, in % of the true one where there is any, and of the slant's sine."""
    rig = STANDARD_PENDULUM
    true = fault.dry * rig.g * rig.l2 / L1**2
    frictions, slant = "-", "-"
    if fault.dry and fault.options:
        found = np.array([[one.extras[name] for name in ("f1", "f2")] for one in runs])
        frictions = " / ".join(f"{100 * error:.2g}" for error in rms(found / true - 1))
    if "slant" in fault.options:
        slant = f"{1e3 * rms(np.array([one.extras['slant'] - np.sin(fault.slant) for one in runs])):.2g}"
    return frictions, slant


def row_of(fault: Fault, runs: Sequence[Published]) -> tuple[str, ...]:
    """Cells as in HEADER; errors are those of the last estimates."""
    done = [one for one in runs if len(one.error)]
    head = f"{fault.angle:g}", fault.label, " ".join(fault.options) or "none", f"{len(done)} of {len(runs)}"
    available = f"{100 * np.mean([one.available for one in runs]):.0f}"
    if not done:
        return (*head, available, *("-",) * 6, "0")
    error, se = (np.array([getattr(one, name)[-1] for one in done]) for name in ("error", "se"))
    return (
        *head,
        available,
        f"{np.median([one.first for one in done]):.1f}",
        " / ".join(f"{100 * one:.2g}" for one in rms(error)),
        f"{100 * np.mean(np.abs(error) < 2 * se):.0f}",
        f"{max(np.abs(one.error / one.se).max() for one in done):.1f}",
        *_of_options(fault, done),
        str(sum(one.confidently_wrong for one in done)),
    )


def options_table(seeds: int, progress: Callable[[], None], cases: Sequence[Fault] = CASES) -> list[tuple[str, ...]]:
    """A row for each case."""
    return table_of(cases, seeds, progress, run_fault, row_of)


@lru_cache(1)
def _motion(dry: float, slant: float) -> dict[str, np.ndarray]:
    phi, y = standard_sensors(BITS).measure(*truth_of(0.1, dry, slant, 40.0), 1)
    return {"phi": phi, "y": y}


def cost_row(options: tuple[str, ...]) -> tuple[str, ...]:
    """Cells as in COST_HEADER: of a motion that has what the options are for."""
    motion = _motion(3e-4 * ("dry_friction" in options), 0.03 * ("slant" in options))
    run = published_run("kapitza", REFINED_TICKS, BOARDS[_BOARD], options, motion)
    found, _ = measured(BOARDS[_BOARD], built_engine(*build_refined_image(BOARDS[_BOARD], run), run.weak.name))
    sizes = (found.mean, found.longest, found.data + found.bss, found.stack_bound, found.text + found.arithmetic)
    return " ".join(options) or "none", *map(str, sizes), str(found.tables)


def cost_table() -> list[tuple[str, ...]]:
    """A row for each choice of the options."""
    return [cost_row(options) for options in ((), _SLANT, _DRY, _BOTH)]
