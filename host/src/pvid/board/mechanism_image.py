"""The replay image of a described mechanism: its generated weak form, the identifier and a run of its simulated rig."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, build, keep_header
from pvid.board.replay_image import REPORT_EVERY, in_blocks
from pvid.codegen import files_weak
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak import config_for_simulated_rig, samples_of
from pvid.core.sizes import smallest
from pvid.core.sources import left_out
from pvid.core.weak_native import WeakIdentifier
from pvid.design.c_tables import float_literal
from pvid.model.compiled import CompiledModel
from pvid.models import mechanisms
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Core
from pvid.settings.weak import WeakConfig
from pvid.sim.simulated_run import RigSimulation

Float32 = npt.NDArray[np.float32]

MISSING = int(np.iinfo(np.int32).min)  # marks a missing sample
_EARLY_WINDOWS = 8  # PVID_WEAK_EARLY_WINDOWS of weak/steps.h
MADE_BY = "pvid.board.mechanism_image"
PERIODS = 3  # half windows whose ticks are counted
LONG_PERIODS = 16  # the same of a long run; the noise is computed anew once in as many
_COUNTS = 2**22  # of a signal without a resolution, over its largest value; a float holds such a count exactly


@dataclass(frozen=True)
class MechanismRun:
    """A run of a mechanism in counts, and the settings to identify it with.

    Attributes
    ----------
    compiled : the mechanism
    config : of the float identifier
    counts : int32 [ticks, samples]; a sample is float32(count) * lsb, rounded once, on the board and here
    lsb : float32 [samples]
    measure_from : first tick that counts in the mean cost of a tick; PERIODS half windows follow, or LONG_PERIODS
    """

    compiled: CompiledModel
    config: WeakConfig
    counts: npt.NDArray[np.int32]
    lsb: Float32
    measure_from: int

    @property
    def name(self) -> str:
        """Of the mechanism, in C."""
        return self.config.design.model.name

    @property
    def samples(self) -> Float32:
        """As the core gets them [ticks, samples]."""
        values = self.counts.astype(np.float32) * self.lsb
        return np.where(self.counts == MISSING, np.float32(np.nan), values).astype(np.float32, copy=False)

    def shortened(self, ticks: int) -> MechanismRun:
        """Its first ticks."""
        design = self.config.design
        start = measured_from(self.config.ticks_needed, design.hop * design.decimation, ticks)
        return replace(self, counts=self.counts[:ticks], measure_from=start)


def run_of_samples(compiled: CompiledModel, config: WeakConfig, samples: Float32) -> MechanismRun:
    """Samples [ticks, samples] in counts: of the sensor, or where it has no resolution, of its largest value."""
    resolution = {one.name: one.resolution for one in compiled.signals}
    largest = np.abs(samples).max(axis=0)
    steps = [
        resolution[one] or top / _COUNTS or 1.0
        for one, top in zip(config.design.model.sample_names, largest, strict=True)
    ]
    lsb = np.asarray(steps, np.float32)
    counts = np.rint(samples.astype(np.float64) / lsb).astype(np.int32)
    return MechanismRun(compiled, config, counts, lsb, 0).shortened(len(counts))


def long_run(first: int, period: int, available: int) -> int:
    """Ticks of a run to count in: the first window, those that have several steps of p, and LONG_PERIODS half windows
    of one step each, or as many as there are samples."""
    return first + min(_EARLY_WINDOWS + LONG_PERIODS, max(available - first, 0) // period) * period


def measured_from(first: int, period: int, ticks: int) -> int:
    """The first tick that counts in such a run, or in a shorter one."""
    whole = max((ticks - first) // period, 0)
    counted = LONG_PERIODS if whole > LONG_PERIODS else min(whole, PERIODS)
    return ticks - counted * period if whole else ticks // 2


@cache
def mechanism_run(name: str, ticks: int | None = None, *, long: bool = False) -> MechanismRun:
    """The shipped rig of a mechanism; `ticks`: by default the first window and PERIODS half windows, or a `long_run`.

    Raises PvidError where there is no such mechanism, or its rig's run is shorter.
    """
    compiled = mechanisms.compiled_of(name)
    config = config_for_simulated_rig(compiled)
    period = config.design.hop * config.design.decimation
    samples = samples_of(config, RigSimulation.of(compiled, simulated_rig(compiled.name)).run())
    wanted = config.ticks_needed + PERIODS * period if ticks is None else ticks
    if long:
        wanted = long_run(config.ticks_needed, period, len(samples))
    if len(samples) < wanted:
        raise PvidError(f"the run of {name} has {len(samples)} samples, too few for {wanted}")
    return run_of_samples(compiled, config, samples).shortened(wanted)


def identifier_of(run: MechanismRun) -> WeakIdentifier:
    """The C core on this machine, initialised for the run."""
    return weak_native(run.compiled, run.config.design).identifier_of(run.config)


def native_hashes(run: MechanismRun) -> npt.NDArray[np.uint32]:
    """Running hash of the C core on this machine after every tick, [ticks]."""
    return identifier_of(run).run_samples(run.samples).hash


def header(run: MechanismRun) -> str:
    """replay_run.h."""
    narrow, missing = np.iinfo(np.int16), run.counts == MISSING
    short = bool(np.abs(np.where(missing, 0, run.counts)).max() <= narrow.max)
    mark, count = (int(narrow.min), "int16_t") if short else (MISSING, "int32_t")
    rows = ["    {" + ", ".join(map(str, row)) + "}," for row in np.where(missing, mark, run.counts).tolist()]
    lsb = ", ".join(map(float_literal, run.lsb))
    return "\n".join(
        [
            f"/* Generated by {MADE_BY}: do not edit. */",
            "#ifndef REPLAY_RUN_H",
            "#define REPLAY_RUN_H",
            "",
            "#include <stddef.h>",
            "",
            '#include "pvid/arithmetic.h"',
            '#include "pvid/fnv.h"',
            f'#include "{run.name}_design_f32.h"',
            "",
            "#define REPLAY_TYPE pvid_weak_f32",
            "#define REPLAY_INIT pvid_weak_init_f32",
            "#define REPLAY_STEP pvid_weak_step_f32",
            "#define REPLAY_HASH pvid_fnv_estimator_f32",
            "#define REPLAY_SAMPLE float",
            f"#define REPLAY_COUNT {count}",
            f"#define REPLAY_CHANNELS {run.counts.shape[1]}u",
            "#define REPLAY_FAULTS pvid_arithmetic_faults_f32()",
            "#define REPLAY_IS_FLOAT 1",
            f'#define REPLAY_FORM "{run.name}, weak"',
            f"#define REPLAY_TICKS {len(run.counts)}u",
            f"#define REPLAY_MEASURE_FROM {run.measure_from}u",
            f"#define REPLAY_REPORT_EVERY {REPORT_EVERY}u",
            f"#define REPLAY_MISSING ({mark + 1} - 1)",
            f"#define replay_config {run.name}_config_f32",
            "",
            f"static const float replay_lsb[REPLAY_CHANNELS] = {{{lsb}}};",
            "/* [tick][sample] in steps of these */",
            f"static const REPLAY_COUNT replay_samples[REPLAY_TICKS][{run.counts.shape[1]}] = {{",
            *rows,
            "};",
            "",
            "#endif",
            "",
        ]
    )


def files_of(run: MechanismRun) -> dict[str, str]:
    """What the image consists of besides the core: name -> text."""
    return files_weak.printed(GeneratedModel(run.compiled, MADE_BY)) | {
        f"{run.name}_design_f32.h": files_weak.design_header(run.config, run.compiled, MADE_BY),
        "replay_run.h": header(run),
    }


def build_mechanism_image(target: Board, run: MechanismRun, *, blocks: bool = False) -> tuple[Path, Path]:
    """Builds the image for a board under build/targets, with arrays of the sizes that the run needs.

    Parameters
    ----------
    blocks : samples are given in blocks

    Returns
    -------
    The image, and the tree it was built in.
    """
    refuse_float_on_avr(target)
    files = files_of(run)
    if blocks:
        files["replay_run.h"] = in_blocks(files["replay_run.h"], "f32")
    return build_with(target, f"{run.name}-weak-f32-{len(run.counts)}", files, fitted_sizes(run.config), "f32")


def refuse_float_on_avr(target: Board) -> None:
    """PvidError for a board on which float32 is another one."""
    if target.toolchain == "avr":
        raise PvidError(
            f"{target.name}: float32 has no bits of the twin on an AVR: its division differs at the extremes"
        )


def build_with(
    target: Board,
    name: str,
    files: Mapping[str, str],
    sizes: Mapping[str, int],
    core: Core,
    room: str = "weak",
    *,
    refined: bool = False,
) -> tuple[Path, Path]:
    """The same from generated files: name -> text.

    Parameters
    ----------
    room : of the core, of the form
    refined : the files of the second stage are among them
    """
    stamp = zlib.crc32("".join(files.values()).encode())
    whole = f"{name}-{stamp:08x}"
    folder = BUILD / "runs" / whole
    for file, text in files.items():
        keep_header((folder / file).parent, Path(file).name, text)
    options = {"PVID_REPLAY_RUN": str(folder), "PVID_LEAVE_OUT": left_out(room, core, *(["refine"] if refined else []))}
    if refined:
        options["PVID_REFINE_MODEL"] = str(folder)
    options |= {macro: str(size) for macro, size in smallest(sizes).items()}
    tree = build(target, BUILD / f"{target.name}-{whole}", options)
    return tree / "apps" / "replay" / "replay.elf", tree
