"""The replay image of a mechanism with both stages: weak engine and refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import Board
from pvid.board.mechanism_image import MADE_BY, MechanismRun, build_with, files_of, mechanism_run
from pvid.codegen import files_refine
from pvid.codegen.build import refine_functions
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.codegen.refine import RefineFunctions
from pvid.codegen.weak_library import weak_native
from pvid.core.weak_native import RefinedIdentifier
from pvid.design.c_tables import float_literal
from pvid.models.registry import DEFAULT
from pvid.models.simulated_rig import simulated_rig
from pvid.run.refine_design import refine_settings
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig
from pvid.sim.pendulum import simulate, standard_sensors

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


def refined_run(name: str, ticks: int, **changes: object) -> RefinedRun:
    """The shipped rig of a mechanism; `changes` of the refinement's settings."""
    run = mechanism_run(name, ticks)
    rig, made = simulated_rig(name), refine_functions(run.compiled)
    names = run.config.design.model.sample_names
    signals = {one: run.samples[:, k] for k, one in enumerate(names)}
    p = np.array([rig.truth[one] for one in run.compiled.p_names])
    settings = refine_settings(made, signals, run.config.sample_rate, p, 2 * rig.window_s)
    return RefinedRun(run, made, replace(settings, **changes))  # type: ignore[arg-type]


def refined_pendulum(ticks: int) -> RefinedRun:
    """The pendulum's standard rig with its full equations and 14 bits, on which the refinement finds its track; the
    ticks behind the first window in which it is published count in the mean.

    Raises
    ------
    PvidError
        Where it is not published within `ticks`.
    """
    run = refined_run(DEFAULT, ticks)
    found = simulate(sensors=standard_sensors(14), truth="full", duration=(ticks + 1) / 1000.0, seed=1).run
    measured = {"phi": found.phi, "y": found.y}
    samples = np.stack([measured[one] for one in run.weak.config.design.model.sample_names], axis=1)[:ticks]
    run = replace(run, weak=replace(run.weak, counts=np.rint(samples / run.weak.lsb).astype(np.int32)))
    published = np.flatnonzero(run.native().run_both(run.weak.samples).told == Reason.UPDATED)
    if not len(published):
        raise PvidError(f"no refined estimate is published within {ticks} ticks")
    return replace(run, weak=replace(run.weak, measure_from=int(published[0])))


def settings_text(settings: RefineConfig, name: str) -> str:
    """The configuration in C: static const `name` and its tables."""
    signals = [
        f"    {{{one.sample}u, {one.order}u, {int(one.source)}u, {_literal(one.scale)}, {_literal(one.range)}}},"
        for one in settings.signal
    ]
    second = [] if settings.second is None else [f"static const float {name}_second[] = {_row(settings.second)};"]
    fields = [
        ("sample_rate_hz", _literal(settings.sample_rate)),
        ("ratio", str(settings.ratio)),
        ("second", f"{name}_second" if second else "NULL"),
        ("signal", f"{name}_signal"),
        *((one, str(getattr(settings, one))) for one in ("block", "first_block", "passes", "most_passes")),
        *((one, _row(getattr(settings, one))) for one in ("sd", "prior_sd", "gain_sd", "state_limit")),
        *(
            (one, _literal(getattr(settings, one)))
            for one in (
                *("forgetting_s", "gate", "chi_max", "clash_max", "step_max", "step_limit"),
                *("se_max", "distance"),
            )
        ),
    ]
    return "\n".join(
        [
            *second,
            f"static const pvid_refine_signal_f32 {name}_signal[] = {{",
            *signals,
            "};",
            f"static const pvid_refine_config_f32 {name} = {{",
            *(f"    .{field} = {value}," for field, value in fields),
            "};",
        ]
    )


def _literal(value: float) -> str:
    return float_literal(np.float32(value))


def _row(values: npt.ArrayLike | Sequence[float]) -> str:
    return "{" + ", ".join(_literal(float(one)) for one in np.asarray(values)) + "}"


def header(run: RefinedRun, text: str) -> str:
    """replay_run.h of the weak form, with the second stage."""
    own = "\n".join(
        [
            '#include "pvid/fnv_refine.h"',
            '#include "pvid/refine.h"',
            "",
            settings_text(run.settings, "replay_refine_config"),
            "static pvid_refine_f32 replay_refinement;",
            "static const pvid_weak_refine_f32 replay_second = {",
            "    &pvid_refine_stage_f32, &replay_refinement, &replay_refine_config};",
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
    files = files_of(run.weak)
    files["replay_run.h"] = header(run, files["replay_run.h"])
    files["pvid/refine_shape.h"] = files_refine.shape(run.made, MADE_BY)
    files["refine_model_f32.h"] = files_refine.header(run.made, MADE_BY)
    name = f"{run.weak.name}-refined-f32-{len(run.weak.counts)}"
    return build_with(target, name, files, fitted_sizes(run.weak.config, refined=True), "f32", refined=True)
