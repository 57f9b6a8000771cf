"""A board that identifies a mechanism by the weak form: settings, generated C, its text in a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.base.wording import printable
from pvid.board.float_board import FloatBoard, recording_header
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.stream_image import MOST_TICKS, StreamImage, refuse_slow
from pvid.codegen import files_refine, files_weak
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import RefineFunctions, refine_functions, widths
from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native, weak_sources
from pvid.codegen.weak_sizes import sizes_of_design
from pvid.configuration.nominal_run import nominal_run
from pvid.configuration.refine import full_motion_of, refine_design
from pvid.configuration.shared import Shared
from pvid.configuration.weak import (
    config_for_recording,
    config_for_simulated_rig,
    config_to_identify,
    samples_of,
    weak_config,
)
from pvid.core.native import Native
from pvid.core.weak_native import RefinedIdentifier, WeakIdentifier
from pvid.link.frames import Configuration, Form
from pvid.link.names import BoardNames, Quantity, shown_of_refined
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import constants_of
from pvid.models.registry import asked_for, is_named, shipped
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.edges import with_edges
from pvid.rig.former import mechanism_of_former, translated
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.cores import CORES, FLOAT
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfig, GateConfig, TrustConfig
from pvid.settings.refine import RefineConfig, RefineSignal
from pvid.settings.text import TABLE, array_of, part_of, written
from pvid.settings.weak import Source as SignalSource
from pvid.settings.weak import WeakConfig, WeakDesign32, WeakFilter, WeakNoise
from pvid.sim.simulated_run import RigSimulation
from pvid.twin.printed import PrintedTwin

if TYPE_CHECKING:
    from pvid.board.strong_board import StrongBoard

_COMMAND = "pvid log"
_ARRAYS: dict[str, type[np.generic]] = {"error_order": np.uint8}  # the others are float32


@dataclass(frozen=True, eq=False)
class MechanismBoard(FloatBoard):
    """What a stream image of the weak form is made for.

    Attributes
    ----------
    refine : settings of the second stage; None: without
    repeats : the sensors read the recording over and over
    """

    form = Form.WEAK
    config: WeakConfig
    refine: RefineConfig | None = None
    repeats: bool = False

    @classmethod
    def of_recording(
        cls,
        rig: MechanismRig,
        recording: Recording,
        to_identify: bool = False,
        ranking: Sequence[Scored] = (),
        refined: bool = False,
    ) -> MechanismBoard:
        """With the design and the tables that a recording of the rig asks for; the board's sensors read it.

        Raises PvidError when the recording is too short, or the identifier or its second stage does not have what the
        model needs.

        Parameters
        ----------
        to_identify : as `identify` does: what is published is judged on this machine
        ranking : as of pvid.configuration.weak.design_for_recording
        refined : with the second stage
        """
        recording.refuse_damaged()
        whole = recording.whole()
        compiled = with_edges(rig.compiled(), whole.signals, whole.sample_rate)
        config = (config_to_identify if to_identify else config_for_recording)(compiled, whole, ranking=ranking)
        refine = refine_design(compiled, config, whole.signals) if refined else None
        return cls(rig, compiled, config, samples_of(config, whole.signals), refine)

    @classmethod
    def of_shipped_rig(cls, name: str, refined: bool = False) -> MechanismBoard:
        """That of a shipped mechanism, whose sensors read a simulation.

        Raises PvidError where there is no such mechanism, or the identifier or its second stage does not have what it
        needs.

        Parameters
        ----------
        refined : with the second stage; the simulation is then one of the equations of the refinement
        """
        simulated = simulated_rig(name)
        rig = MechanismRig(name, simulated.sample_rate, known=constants_of(name, simulated.knowns))
        compiled = rig.compiled()
        config = config_for_simulated_rig(compiled)
        if not refined:
            return cls(rig, compiled, config, samples_of(config, RigSimulation.of(compiled, simulated).run()))
        run = full_motion_of(compiled)
        refine = refine_design(compiled, config, run, [simulated.truth[one] for one in compiled.p_names])
        return cls(rig, compiled, config, samples_of(config, run), refine)

    @classmethod
    def of_guess(cls, rig: MechanismRig, refined: bool = False) -> MechanismBoard:
        """With a design for the guess of a rig; the sensors of an emulated board read a simulation of it.

        Raises PvidError where there is no such simulation (see `nominal_run`), or the identifier does not have what the
        model needs.

        Parameters
        ----------
        refined : with the second stage. The simulation follows the equations of the weak form: where those of the
            refinement are others, they contradict it.
        """
        made = nominal_run(rig)
        run = made.recording.signals
        config = weak_config(made.compiled, run, made.chosen.design, made.p, shared=True)
        # What the rig really reads is not known: a height from the floor is no fault.
        config = replace(config, range=None)
        refine = refine_design(made.compiled, config, run, made.p) if refined else None
        return cls(rig, made.compiled, config, samples_of(config, run)[:MOST_TICKS], refine)

    def __post_init__(self) -> None:
        refuse_slow(self.config.sample_rate)

    @cached_property
    def equations(self) -> RefineFunctions:
        """Those of the second stage."""
        return refine_functions(self.compiled)

    @property
    def names(self) -> BoardNames:
        """What the board says about itself."""
        units = {one.name: one.unit for one in self.compiled.signals}
        refined = [self.equations.parameters[place] for place in self.shown]
        return BoardNames(
            self.config.design.model.name,
            tuple(Quantity(name, units[name]) for name in self.config.design.model.sample_names),
            tuple(Quantity(one.name, one.unit) for one in self.compiled.unknowns),
            refined=tuple(Quantity(one.name, "" if one.unit == "1" else one.unit) for one in refined),
        )

    @property
    def shown(self) -> tuple[int, ...]:
        """Refined parameters that the board sends."""
        if self.refine is None:
            return ()
        made = self.equations
        return shown_of_refined(len(made.parameters), len(widths(made)), made.places_of_p)

    @property
    def stream_image(self) -> StreamImage:
        """Headers, generated C and sizes."""
        code = files_weak.printed(GeneratedModel(self.compiled, _COMMAND))
        code["stream_tables.h"] = files_weak.design_header(self._shared, self.compiled, _COMMAND)
        if self.refine is not None:
            code |= files_refine.files_of(self.equations, _COMMAND)
            code["stream_refine.h"] = _refine_header(self.refine, self.shown)
        return StreamImage.made(
            "weak",
            "f32",
            own=[f"#define STREAM_CONFIG {self.config.design.model.name}_config_f32"],
            names=self.names,
            sample_rate=self.sample_rate,
            units=["1.0f"] * len(self.compiled.unknowns),
            code=code,
            recording=recording_header(self.recording),
            sizes=sizes_of_design(self.config.design),
            refined=self.refine is not None,
            more=[
                *([] if self.refine is None else ["#define STREAM_REFINED"]),
                *(["#define STREAM_REPEATS"] if self.repeats else []),
            ],
        )

    def twin_of(self, frame: Configuration) -> PrintedTwin:
        """The twin with the values of a Configure frame; raises as `configured`."""
        equations = None if self.refine is None else self.equations
        return PrintedTwin(
            weak_sources(self.compiled, self.config.design, equations), self.configured(frame), self.refine
        )

    def core_of(self, frame: Configuration) -> WeakIdentifier:
        """The core, compiled on this machine, with the values of a Configure frame; raises as `configured`, and where
        there is no compiler."""
        config = self.configured(frame)
        return self._weak(config) if self.refine is None else self._both_stages(config)

    def hashes(self, _: Native, *signals: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the identifier on this machine [ticks]."""
        samples = self.readings(*signals)
        if self.refine is None:
            return self._weak(self.config).run_samples(samples, sums=False).hash
        return self.both_stages().run_both(samples).hash

    def both_stages(self) -> RefinedIdentifier:
        """Both stages in C on this machine."""
        return self._both_stages(self.config)

    def _weak(self, config: WeakConfig) -> WeakIdentifier:
        return weak_native(self.compiled, self.config.design).identifier_of(config)

    def _both_stages(self, config: WeakConfig) -> RefinedIdentifier:
        assert self.refine is not None
        return weak_native(self.compiled, self.config.design, self.equations).refined_of(config, self.refine)

    def text(self) -> str:
        """The rig file with the identifier's settings, for a log; `parse` gives the same board back."""
        lines = [f"{name} = {written(value)}" for name, value in _flat(self.config, self.refine).items()]
        return "\n".join([self.rig.text(), f"[{TABLE}]", *lines, ""])

    @classmethod
    def of_tables(cls, rig: MechanismRig, settings: Mapping[str, Any]) -> MechanismBoard:
        """From the rig and the table of settings in the text of a log.

        Raises KeyError, TypeError, ValueError, IndexError where it is damaged.
        """
        compiled = rig.compiled()
        config = _config(compiled, settings)
        nothing = np.zeros((0, config.design.model.samples), np.float32)
        return cls(rig, compiled, config, nothing, _refine(settings))


def _refine_header(settings: RefineConfig, shown: Sequence[int]) -> str:
    """stream_refine.h: `stream_refine_config`, and which entries of r the board sends."""
    lines = ['#include "pvid/refine.h"', "", *files_refine.design_tables(settings, "stream_refine_config"), ""]
    lines += [f"#define STREAM_SHOWN {len(shown)}", "/* Entries of r that the board sends. */"]
    lines += [f"static const uint8_t stream_shown[STREAM_SHOWN] = {{{', '.join(map(str, shown))}}};"]
    return "\n".join(["#ifndef STREAM_REFINE_H", "#define STREAM_REFINE_H", "", *lines, "", "#endif", ""])


def board_of_guess(rig: MechanismRig, core: str, refined: bool = False) -> MechanismBoard | MechanismBoardQ31:
    """In one arithmetic; raises as MechanismBoard.of_guess, and for a second stage in fixed point."""
    if not refined:
        return BOARDS[core].of_guess(rig)
    refuse_unrefined(core)
    return MechanismBoard.of_guess(rig, refined=True)


def refuse_unrefined(core: str) -> None:
    """PvidError for a core without a second stage."""
    if core != FLOAT.name:
        raise PvidError(f"the second stage is in float32 alone: --refine with core {FLOAT.name}, not {core}")


_KINDS: tuple[type[MechanismBoard] | type[MechanismBoardQ31], ...] = (MechanismBoard, MechanismBoardQ31)
BOARDS = dict(zip(CORES, _KINDS, strict=True))


def board_of(text: str, model: str | None = None) -> MechanismBoard | MechanismBoardQ31 | StrongBoard | None:
    """From the text of a log; None: that of another kind of rig.

    Raises PvidError where it breaks off, or names a mechanism that is not shipped and not that of this call.

    Parameters
    ----------
    model : name or model file of this call; a log of one's own mechanism needs it
    """
    document = toml_document(text)
    settings = document.pop(TABLE, None)
    if not isinstance(settings, dict):
        return None
    former = mechanism_of_former(document)
    rig = MechanismRig.of_document(document if former is None else translated(document, former), former)
    named = str(rig.model)
    if model is None:
        shipped(named)
    elif not is_named(asked_for(model), named):
        raise PvidError(f"the log is of the mechanism {printable(named)}, and not of --model {model}")
    else:
        rig = replace(rig, model=asked_for(model))
    try:
        if settings.pop("form", "") == "strong":
            from pvid.board.strong_board import StrongBoard

            return StrongBoard.of_tables(rig, settings)
        return BOARDS[settings.pop("core", FLOAT.name)].of_tables(rig, settings)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise PvidError(f"the settings of the identifier in the log are damaged: {error}") from error


# ---- the text of the settings


def _flat(config: WeakConfig, refine: RefineConfig | None) -> dict[str, Any]:
    """Key -> value; keys of the parts have their names in front."""
    parts: dict[str, Any] = {
        "estimator": config.estimator,
        "trust": config.trust,
        "gate": config.gate,
        "design": config.design,
    }
    found = {one.name: getattr(config, one.name) for one in fields(config) if one.name not in (*parts, "causes")}
    if refine is not None:
        parts["refine"] = refine
    for part, owner in parts.items():
        found |= {f"{part}_{one.name}": getattr(owner, one.name) for one in fields(owner) if one.name != "model"}
    return {name: value for name, value in found.items() if value is not None}


def _refine(settings: Mapping[str, Any]) -> RefineConfig | None:
    given = part_of(settings, "refine")
    if not given:
        return None
    signal = tuple(
        RefineSignal(sample, order, scale, range_, SignalSource(source))
        for sample, order, scale, range_, source in given.pop("signal")
    )
    given.pop("gain_sd", None)  # of former logs, whose first stage's table has the gains now
    arrays: dict[str, Any] = {
        key: array_of(value) if isinstance(value, list | str) else value for key, value in given.items()
    }
    return RefineConfig(**{"second": None, **arrays}, signal=signal)


def _config(compiled: CompiledModel, settings: Mapping[str, Any]) -> WeakConfig:
    def part(name: str) -> dict[str, Any]:
        return part_of(settings, name)

    def arrays(values: dict[str, Any]) -> dict[str, Any]:
        return {
            key: array_of(value, _ARRAYS.get(key, np.float32)) if isinstance(value, list | str) else value
            for key, value in values.items()
        }

    design = part("design")
    filters = tuple(WeakFilter(array_of(one)) for one in design.pop("filter"))
    at_steps = design.pop("compensator", None)
    compensators = filters if at_steps is None else tuple(WeakFilter(array_of(one)) for one in at_steps)
    noise = tuple(WeakNoise(kind, power, a, b, np.float32(x)) for kind, power, a, b, x in design.pop("noise"))
    made = WeakDesign32(
        model=weak_model_of(compiled), filter=filters, compensator=compensators, noise=noise, **arrays(design)
    )
    estimator, trust = arrays(part("estimator")), {"age_max": 0} | arrays(part("trust"))  # 0: of former logs
    if "neglected" in trust:
        trust["shared"] = Shared.of_part(compiled, trust.pop("neglected")).triangle
    own = {one.name: settings[one.name] for one in fields(WeakConfig) if one.name in settings}
    return WeakConfig(
        **arrays(own),
        design=made,
        estimator=EstimatorConfig(**{**estimator, "law": Law(estimator["law"])}),
        trust=TrustConfig(**trust),
        gate=GateConfig(**part("gate")),
    )
