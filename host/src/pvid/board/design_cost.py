"""What a design costs on an emulated board, before one is flashed: its replay image with a run of the rig, measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS, Board
from pvid.board.longest_tick import CORE, longest_tick
from pvid.board.mechanism_board import refuse_unrefined
from pvid.board.mechanism_image import (
    MechanismRun,
    build_mechanism_image,
    identifier_of,
    long_run,
    refuse_float_on_avr,
    run_of_samples,
)
from pvid.board.mechanism_image_q31 import FixedRun, build_fixed_image
from pvid.board.mechanism_image_q31 import identifier_of as fixed_identifier_of
from pvid.board.refined_image import RefinedRun, build_refined_image, light_work
from pvid.board.replay_image import BLOCK
from pvid.board.sizes import REFINED, WEAK, WITH_DMA, BuiltImage, Footprint, built_weak, figures_of, measured
from pvid.board.tick_bound import TickBound
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_q31 import WeakQ31
from pvid.configuration.refine import full_motion_of, refine_design, refine_for_simulated_rig
from pvid.configuration.weak import (
    Run,
    config_for_recording,
    config_for_rig_like_the_shipped,
    samples_of,
    simulated_run_of,
)
from pvid.configuration.weak_q31 import weak_q31_for_recording, weak_q31_for_rig_like_the_shipped
from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording
from pvid.settings.cores import FLOAT
from pvid.settings.enums import Core, Reason
from pvid.settings.refine import BIG_STEP, RefineConfig
from pvid.settings.weak import WeakConfig

MOST_TICKS = 40_000  # that are replayed


@dataclass(frozen=True)
class Asked:
    """Which costs.

    Attributes
    ----------
    board : an emulated one
    core : arithmetic of the weak form
    refined : both stages as well
    clock_mhz : of the user's board; None: not given
    """

    board: Board
    core: Core = FLOAT.name
    refined: bool = False
    clock_mhz: float | None = None

    @classmethod
    def of(cls, target: str, core: Core, *, refined: bool, clock_mhz: float | None) -> Asked:
        """PvidError where there is no such board, or it does not have these."""
        if target not in BOARDS:
            raise PvidError(f"{target} is no emulated board: the cost is measured on {', '.join(BOARDS)}")
        if refined:
            refuse_unrefined(core)
        if core == FLOAT.name:
            refuse_float_on_avr(BOARDS[target])
        return cls(BOARDS[target], core, refined, clock_mhz)


@dataclass(frozen=True)
class Cost:
    """Of the weak form, or of both stages.

    Attributes
    ----------
    asked : what was measured
    model : of the mechanism, in C
    footprint : mean of the ticks in whole half windows, or behind the first refined estimate; the longest of all ticks
    ticks : that were replayed
    sample_rate : [Hz]
    first_s : time of the first published estimate; of both stages, of the refined one [s]; None: none was replayed
    equal : whether every hash that the board reported is that of the C core on this machine
    in_blocks : the weak form with samples in blocks of BLOCK: mean of a sample, longest of a block; None: both stages,
        or a board that is not in WITH_DMA
    refine : settings of the second stage; None: without
    most : of a tick of the weak form, with samples that are spoilt as well; None: both stages, or no board with a CORE
    """

    asked: Asked
    model: str
    footprint: Footprint
    ticks: int
    sample_rate: float
    first_s: float | None
    equal: bool
    refine: RefineConfig | None = None
    in_blocks: Footprint | None = None
    most: TickBound | None = None

    @property
    def shares(self) -> tuple[float, float] | None:
        """Mean and longest tick as parts of the time between samples, one instruction a cycle; None: no clock."""
        if self.asked.clock_mhz is None:
            return None
        cycles = 1e6 * self.asked.clock_mhz / self.sample_rate
        return self.footprint.mean / cycles, self.footprint.longest / cycles

    def as_json(self) -> dict[str, Any]:
        """An entry of `cost` of `design --on --json`: as of `sizes --json`, and how it was measured."""
        own, blocks, most = self.refine, self.in_blocks, self.most
        shares = {} if self.shares is None else dict(zip(("mean_share", "longest_share"), self.shares, strict=True))
        return {
            "target": self.asked.board.name,
            "model": self.model,
            "form": WEAK if own is None else REFINED,
            "core": self.asked.core,
            **figures_of(self.footprint),
            **({} if own is None else {"jobs": own.jobs, "rests": own.rests}),
            "ticks": self.ticks,
            "first_s": self.first_s,
            **shares,
            **({} if most is None else {"searched": most.longest, "bound": most.bound}),
            **({} if blocks is None else {"block": {"samples": BLOCK, "mean": blocks.mean, "longest": blocks.longest}}),
        }


@dataclass(frozen=True, eq=False)
class CostedDesign:
    """A design for a rig with a run of it.

    Attributes
    ----------
    compiled : the mechanism
    weak : its weak form
    run : name of each signal -> samples
    refine : settings of the second stage, as `model build` prints them; None: without
    no_refinement : why there are none, where they are asked for
    """

    compiled: CompiledModel
    weak: WeakConfig | WeakQ31
    run: Run
    refine: RefineConfig | None = None
    no_refinement: str | None = None

    @classmethod
    def of_recording(cls, asked: Asked, compiled: CompiledModel, recording: Recording) -> CostedDesign:
        """That which `model build --run` prints.

        Raises PvidError where the identifier does not have what the model needs.
        """
        run = recording.signals
        if asked.core != FLOAT.name:
            return cls(compiled, weak_q31_for_recording(compiled, recording), run)
        config = config_for_recording(compiled, recording)
        return cls(compiled, config, run)._with_refinement(asked, lambda: refine_design(compiled, config, run))

    @classmethod
    def of_shipped_rig(cls, asked: Asked, compiled: CompiledModel) -> CostedDesign:
        """That of a shipped mechanism's simulated rig; raises as of_recording."""
        if asked.core != FLOAT.name:
            return cls(compiled, weak_q31_for_rig_like_the_shipped(compiled), simulated_run_of(compiled)[0])
        config = config_for_rig_like_the_shipped(compiled)
        run = full_motion_of(compiled) if asked.refined else simulated_run_of(compiled)[0]
        return cls(compiled, config, run)._with_refinement(asked, lambda: refine_for_simulated_rig(compiled, config))

    def _with_refinement(self, asked: Asked, made: Callable[[], RefineConfig]) -> CostedDesign:
        if not asked.refined:
            return self
        reason = GeneratedModel(self.compiled, "").refinement.refusal
        if reason is None:
            try:
                return replace(self, refine=made())
            except PvidError as error:
                reason = str(error)
        return replace(self, no_refinement=reason)

    def images(self, asked: Asked) -> list[RefineConfig | None]:
        """Settings of the second stage of each image: the weak form alone, then those of `model build`, then those
        with a short longest tick."""
        if self.refine is None:
            return [None]
        light = replace(self.refine, **light_work(asked.board))  # type: ignore[arg-type]
        return [None, self.refine, *([] if _work(light) == _work(self.refine) else [light])]

    def cost(self, asked: Asked, refine: RefineConfig | None) -> Cost:
        """Builds an image, replays the run on the board and on this machine.

        Raises PvidError when a compiler or the emulator is missing, or the image does not fit or fails.
        """
        if isinstance(self.weak, WeakQ31):
            return _in_fixed_point(asked, self.weak, self.run)
        return _in_float(asked, self.compiled, self.weak, self.run, refine)


def _work(refine: RefineConfig) -> tuple[int, int]:
    return refine.jobs, refine.rests


def _in_float(
    asked: Asked, compiled: CompiledModel, config: WeakConfig, signals: Run, refine: RefineConfig | None
) -> Cost:
    samples = samples_of(config, signals)
    run = run_of_samples(compiled, config, samples[: _most_ticks(asked.board, 4 * samples.shape[1])])
    rate, period = config.sample_rate, config.design.hop * config.design.decimation
    if refine is None:
        record = identifier_of(run).run_samples(run.samples, sums=False)
        first = _first(record.reason)
        run = run.shortened(_enough(first, config.ticks_needed, period, len(run.counts)))
        built = built_weak(*build_mechanism_image(asked.board, run), run.name)
        blocks = None
        if asked.board.name in WITH_DMA:
            image = built_weak(*build_mechanism_image(asked.board, run, blocks=True), run.name)
            blocks = image, identifier_of(run).run_in_blocks(run.samples, BLOCK)
        found = _measured(asked, run.name, built, record.hash, first, rate, blocks=blocks)
        return replace(found, most=_most(asked, run))
    both = RefinedRun(run, refine_functions(compiled), refine)
    record_of_both = both.native().run_both(run.samples)
    first = _first(record_of_both.told)
    block = refine.block * BIG_STEP * refine.ratio
    run = run.shortened(_enough(first, config.ticks_needed, block, len(run.counts)))
    both = replace(both, weak=run if first is None else replace(run, measure_from=first))
    built = built_weak(*build_refined_image(asked.board, both), run.name)
    return _measured(asked, run.name, built, record_of_both.hash, first, rate, refine)


def _in_fixed_point(asked: Asked, weak: WeakQ31, signals: Run) -> Cost:
    counts = weak.counts_of(signals)
    run = FixedRun(weak, counts, 0)
    run = replace(run, counts=counts[: _most_ticks(asked.board, run.count_bytes * counts.shape[1])])
    record = fixed_identifier_of(run).run_samples(run.counts, sums=False)
    first = _first(record.reason)
    period = weak.config.design.hop * weak.config.design.decimation
    run = run.shortened(_enough(first, weak.ticks_needed, period, len(run.counts)))
    built = built_weak(*build_fixed_image(asked.board, run), run.name)
    blocks = None
    if asked.board.name in WITH_DMA:
        image = built_weak(*build_fixed_image(asked.board, run, blocks=True), run.name)
        blocks = image, fixed_identifier_of(run).run_in_blocks(run.counts, BLOCK)
    found = _measured(asked, run.name, built, record.hash, first, weak.sample_rate, blocks=blocks)
    return replace(found, most=_most(asked, run))


def _most(asked: Asked, run: MechanismRun | FixedRun) -> TickBound | None:
    return longest_tick(asked.board, run) if asked.board.core == CORE else None


def _most_ticks(board: Board, bytes_a_tick: int) -> int:
    return min(MOST_TICKS, board.sample_bytes // bytes_a_tick)


def _first(reason: npt.NDArray[np.uint8]) -> int | None:
    """The first tick with an estimate."""
    found = np.flatnonzero(np.isin(reason, (Reason.UPDATED, Reason.MISFIT)))
    return int(found[0]) if len(found) else None


def _enough(first: int | None, ticks_needed: int, period: int, ticks: int) -> int:
    """Ticks to replay: up to the steady state behind the first estimate, as far as the run goes; without an estimate
    the whole run."""
    return ticks if first is None else long_run(max(first + 1, ticks_needed), period, ticks)


def _measured(
    asked: Asked,
    model: str,
    built: BuiltImage,
    hashes: npt.NDArray[np.uint32],
    first: int | None,
    rate: float,
    refine: RefineConfig | None = None,
    blocks: tuple[BuiltImage, npt.NDArray[np.uint32]] | None = None,
) -> Cost:
    footprint, report = measured(asked.board, built)
    equal, in_blocks = report.differs_at(hashes) is None, None
    if blocks is not None:
        in_blocks, of_blocks = measured(asked.board, blocks[0])
        equal = equal and of_blocks.differs_at(blocks[1]) is None
    return Cost(
        asked,
        model,
        footprint,
        report.ticks,
        rate,
        None if first is None else (first + 1) / rate,
        equal,
        refine,
        in_blocks,
    )
