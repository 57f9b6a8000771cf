"""The replay image of a mechanism with both stages: weak identifier and refinement."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pvid.base.errors import PvidError
from pvid.board.boards import Board
from pvid.board.mechanism_image import MADE_BY, MechanismRun, build_with, files_of, measured_from, mechanism_run
from pvid.codegen import files_refine
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.codegen.refine import RefineFunctions, refine_functions
from pvid.codegen.weak_library import weak_native
from pvid.configuration.refine import full_motion_of, refine_settings
from pvid.core.weak_native import RefinedIdentifier
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig

_START = "#define REPLAY_INIT pvid_weak_init_f32"
_HASH = "#define REPLAY_HASH pvid_fnv_estimator_f32"


@dataclass(frozen=True)
class RefinedRun:
    """A run of a mechanism, the functions of its refinement and their settings."""

    weak: MechanismRun
    made: RefineFunctions
    settings: RefineConfig

    def native(self) -> RefinedIdentifier:
        """Both stages in C on this machine."""
        return weak_native(self.weak.compiled, self.weak.config.design, self.made).refined_of(
            self.weak.config, self.settings
        )


def refined_run(name: str, ticks: int, options: Collection[str] = (), **changes: object) -> RefinedRun:
    """The shipped rig of a mechanism; `options` and `changes` of the settings are the refinement's."""
    run = mechanism_run(name, ticks)
    run = replace(run, compiled=run.compiled.with_options(options))
    rig, made = simulated_rig(name), refine_functions(run.compiled)
    names = run.config.design.model.sample_names
    signals = {one: run.samples[:, k] for k, one in enumerate(names)}
    p = np.array([rig.truth[one] for one in run.compiled.p_names])
    settings = refine_settings(made, signals, run.config.sample_rate, p, 2 * rig.window_s)
    return RefinedRun(run, made, replace(settings, **changes))  # type: ignore[arg-type]


def light_work(board: Board) -> dict[str, int]:
    """Settings of the refinement with which the longest tick is short: without a floating point unit a tick has one
    job, and ticks in which the weak form is busy have none."""
    return {"jobs": 3 if board.has_fpu else 1, "rests": 255}


def published_run(
    name: str,
    ticks: int,
    board: Board,
    options: Collection[str] = (),
) -> RefinedRun:
    """The shipped rig of a mechanism with the equations of its refinement; the ticks of the steady state count in the
    mean, as in mechanism_run, behind the first window in which a refined estimate is published.

    Raises PvidError where it is not published within `ticks`.

    Parameters
    ----------
    options : of the refinement; Runge-Kutta's steps have their usual jobs, with fewer they are too late
    """
    run = refined_run(name, ticks, options)
    if not run.made.runge_kutta:
        run = replace(run, settings=replace(run.settings, **light_work(board)))  # type: ignore[arg-type]
    measured = full_motion_of(run.weak.compiled, ticks / run.weak.config.sample_rate)
    samples = np.stack([np.asarray(measured[one]) for one in run.weak.config.design.model.sample_names], axis=1)[:ticks]
    run = replace(run, weak=replace(run.weak, counts=np.rint(samples / run.weak.lsb).astype(np.int32)))
    published = np.flatnonzero(run.native().run_both(run.weak.samples).told == Reason.UPDATED)
    if not len(published):
        raise PvidError(f"no refined estimate is published within {ticks} ticks")
    config = run.weak.config
    steady = measured_from(config.ticks_needed, config.design.hop * config.design.decimation, ticks)
    return replace(run, weak=replace(run.weak, measure_from=max(int(published[0]), steady)))


def header(run: RefinedRun, text: str) -> str:
    """replay_run.h of the weak form, with the second stage."""
    own = "\n".join(
        [
            '#include "pvid/fnv_refine.h"',
            '#include "pvid/refine.h"',
            "",
            *files_refine.design_tables(run.settings, "replay_refine_config"),
            "static pvid_refine_f32 replay_refinement;",
            "static const pvid_weak_refine_f32 replay_second = {",
            "    &pvid_refiner_f32, &replay_refinement, &replay_refine_config};",
            "",
            "static pvid_status replay_init(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)",
            "{",
            "    pvid_weak_config_f32 both = *config;",
            "    both.refine = &replay_second;",
            "    return pvid_weak_init_f32(self, &both);",
            "}",
            "",
            "static uint32_t replay_hash(uint32_t hash, const pvid_estimator_f32 *estimator, pvid_reason reason)",
            "{",
            "    const uint32_t weak = pvid_fnv_estimator_f32(hash, estimator, reason);",
            "    return pvid_fnv_refine_f32(weak, &replay_refinement, pvid_refine_reason_f32(&replay_refinement));",
            "}",
            "",
            "#define REPLAY_INIT replay_init",
        ]
    )
    return text.replace(_START, own).replace(_HASH, "#define REPLAY_HASH replay_hash")


def build_refined_image(target: Board, run: RefinedRun) -> tuple[Path, Path]:
    """Builds the image; see `build_mechanism_image`."""
    files = files_of(run.weak) | files_refine.files_of(run.made, MADE_BY)
    files["replay_run.h"] = header(run, files["replay_run.h"])
    name = f"{run.weak.name}-refined-f32-{len(run.weak.counts)}"
    sizes = fitted_sizes(run.weak.config, refined=True)
    return build_with(target, name, files, sizes, "f32", refined=True)
