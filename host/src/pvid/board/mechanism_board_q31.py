"""A board that identifies a mechanism by the weak form in fixed point; as mechanism_board."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.stream_image import MOST_TICKS, StreamImage, refuse_slow
from pvid.codegen import files_weak_q31
from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_library import weak_native_q31, weak_sources_q31
from pvid.codegen.weak_q31 import JetReaches, WeakQ31, fixed_weak
from pvid.configuration.nominal_run import nominal_run
from pvid.configuration.shared import Shared
from pvid.configuration.weak_q31 import (
    weak_q31_for_recording,
    weak_q31_for_run,
    weak_q31_for_simulated_rig,
    weak_q31_of_parts,
    weak_q31_to_identify,
)
from pvid.core.native import Native
from pvid.core.weak_native_q31 import WeakIdentifierQ31
from pvid.design.c_tables import float_literal
from pvid.design.weak_q31 import circle_of
from pvid.link.frames import Configuration, ConfigureQ31, Count, Form, Message, Source, in_places
from pvid.link.names import BoardNames, Quantity
from pvid.models.mechanisms import constants_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.edges import with_edges
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, TrustConfigQ31
from pvid.settings.text import TABLE
from pvid.settings.weak_q31 import Rescale, WeakConfigQ31, WeakDesignQ31, WeakFilterQ31, WeakFormatQ31, WeakNoiseQ31
from pvid.sim.simulated_run import RigSimulation
from pvid.twin.printed import PrintedTwin

_COMMAND = "pvid log"
_PER_PARAMETER = ("start", "start_sd", "lower", "upper")
_SINGLE = ("row_sd", "forgetting_groups", "gain", "divider")
_COMPUTED = ("model", "circle", "units", "margins")  # of a design: not in the text
_WIDTH = 16  # entries a line


@dataclass(frozen=True, eq=False)
class MechanismBoardQ31:
    """What a stream image is made for.

    Attributes
    ----------
    rig : of the mechanism
    weak : functions, settings and tables
    recording : what the board's sensors count, int32 [ticks, samples]; empty as of MechanismBoard
    """

    configure_frame = ConfigureQ31
    matrix = "correlation"  # of an estimate
    rig: MechanismRig
    weak: WeakQ31
    recording: npt.NDArray[np.int32]

    @classmethod
    def of_recording(
        cls, rig: MechanismRig, recording: Recording, to_identify: bool = False, ranking: Sequence[Scored] = ()
    ) -> MechanismBoardQ31:
        """As MechanismBoard.of_recording."""
        recording.refuse_damaged()
        whole = recording.whole()
        compiled = with_edges(rig.compiled(), whole.signals, whole.sample_rate)
        weak = (weak_q31_to_identify if to_identify else weak_q31_for_recording)(compiled, whole, ranking=ranking)
        return cls(rig, weak, weak.counts_of(whole.signals))

    @classmethod
    def of_shipped_rig(cls, name: str) -> MechanismBoardQ31:
        """As MechanismBoard.of_shipped_rig."""
        simulated = simulated_rig(name)
        rig = MechanismRig(name, simulated.sample_rate, known=constants_of(name, simulated.knowns))
        compiled = rig.compiled()
        weak = weak_q31_for_simulated_rig(compiled)
        return cls(rig, weak, weak.counts_of(RigSimulation.of(compiled, simulated).run()))

    @classmethod
    def of_guess(cls, rig: MechanismRig) -> MechanismBoardQ31:
        """As MechanismBoard.of_guess."""
        made = nominal_run(rig)
        run = made.recording.signals
        weak = weak_q31_for_run(made.compiled, run, made.chosen.design, made.p, shared=True)
        return cls(rig, weak, weak.counts_of(run)[:MOST_TICKS])

    def __post_init__(self) -> None:
        refuse_slow(self.weak.sample_rate)

    @property
    def config(self) -> WeakConfigQ31:
        """Settings and tables."""
        return self.weak.config

    @property
    def names(self) -> BoardNames:
        """What the board says about itself."""
        compiled = self.weak.compiled
        units = {one.name: one.unit for one in compiled.signals}
        return BoardNames(
            self.weak.name,
            tuple(Quantity(name, units[name]) for name in self.weak.sample_names),
            tuple(Quantity(one.name, one.unit) for one in compiled.unknowns),
            self.weak.lsb,
        )

    @property
    def p_names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(name for name, _ in self.names.parameters)

    @property
    def sample_rate(self) -> float:
        """Ticks a second."""
        return self.weak.sample_rate

    @property
    def without_recording(self) -> MechanismBoardQ31:
        """The same, for a board that gets its samples from the PC."""
        return replace(self, recording=self.recording[:1])

    def readings(self, *signals: npt.ArrayLike) -> npt.NDArray[np.int32]:
        """Counts [ticks] as the identifier takes them [ticks, samples]."""
        return np.stack([np.asarray(one, np.int32) for one in signals], axis=1)

    def frame(self, readings: npt.NDArray[Any]) -> Message:
        """The frame of consecutive ticks [ticks, samples]."""
        return Count.of_values(*readings.T)

    def hashes(self, _: Native, *signals: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the identifier on this machine [ticks]."""
        identifier = weak_native_q31(self.weak.made, self.weak.parameters, self.weak.config).identifier()
        return identifier.run_samples(self.readings(*signals), sums=False).hash

    @property
    def stream_image(self) -> StreamImage:
        """Headers, generated C and sizes."""
        weak, name, sizes = self.weak, self.weak.name, files_weak_q31.sizes_of(self.weak)
        code = {
            f"{name}_weak_q31.h": files_weak_q31.header(weak.made, sizes, _COMMAND),
            f"{name}_weak_q31.c": files_weak_q31.source(weak.made, weak.parameters, _COMMAND),
            "stream_tables.h": files_weak_q31.design_header(self.config, name, sizes, _COMMAND, []),
        }
        return StreamImage.made(
            "weak",
            "q31",
            own=[f"#define STREAM_CONFIG {name}_config_q31"],
            names=self.names,
            sample_rate=self.sample_rate,
            units=[float_literal(np.float32(2.0**-bits)) for bits in weak.parameters.p_bits],
            code=code,
            recording=_recording(self.recording),
            sizes=sizes,
        )

    def configure(
        self, settings: int, hash_every: int, estimate_every: int, source: Source = Source.PC, first_tick: int = 0
    ) -> Configuration:
        """The frame that configures a board whose image has these `settings`, with a new session number."""
        own = self.config.estimator
        places: dict[str, Any] = {name: in_places(getattr(own, name)) for name in _PER_PARAMETER}
        return ConfigureQ31(
            session=secrets.randbelow(2**32 - 1) + 1,
            settings=settings,
            form=int(Form.WEAK),
            source=int(source),
            hash_every=hash_every,
            estimate_every=estimate_every,
            phi_offset=0,
            y_offset=0,
            first_tick=first_tick,
            **places,
            **{name: getattr(own, name) for name in _SINGLE},
        )

    def configured(self, frame: Configuration) -> WeakConfigQ31:
        """The settings with the values of a Configure frame. Raises PvidError for one of the other core."""
        if not isinstance(frame, self.configure_frame):
            raise PvidError("the board's image contains another core than the log's settings")
        frame.refuse_fewer(self.p_names)
        own = self.config.estimator
        places: dict[str, Any] = {name: tuple(getattr(frame, name)[: len(own.start)]) for name in _PER_PARAMETER}
        single = {name: getattr(frame, name) for name in _SINGLE}
        return replace(self.config, estimator=replace(own, **places, **single))

    def twin_of(self, frame: Configuration) -> PrintedTwin:
        """The twin with the values of a Configure frame; raises as `configured`."""
        sources = weak_sources_q31(self.weak.made, self.weak.parameters, self.config)
        return PrintedTwin(sources, self.configured(frame))

    def core_of(self, frame: Configuration) -> WeakIdentifierQ31:
        """The core, compiled on this machine, with the values of a Configure frame; raises as `configured`, and where
        there is no compiler."""
        library = weak_native_q31(self.weak.made, self.weak.parameters, self.config)
        return library.identifier(estimator=self.configured(frame).estimator)

    def text(self) -> str:
        """The rig file with the identifier's settings, for a log; `of_tables` gives the same board back."""
        lines = [f"{name} = {_written(value)}" for name, value in _flat(self.weak).items()]
        return "\n".join([self.rig.text(), f"[{TABLE}]", *lines, ""])

    @classmethod
    def of_tables(cls, rig: MechanismRig, weak: Mapping[str, Any]) -> MechanismBoardQ31:
        """From the rig and the table of settings in the text of a log.

        Raises KeyError, TypeError, ValueError, IndexError where it is damaged.
        """
        for value in weak.values():
            _refuse_words(value)
        compiled = rig.compiled()
        functions = weak_functions_of(compiled)
        of_jets = dict(zip(functions.jet_names, map(float, weak["jet_reach"]), strict=True))
        made = fixed_weak(functions, JetReaches(run_s=float(weak["run_s"]), of=of_jets))

        def part(name: str) -> dict[str, Any]:
            keys = {key: value for key, value in weak.items() if key.startswith(f"{name}_")}
            return {key.removeprefix(f"{name}_"): _tuples(value) for key, value in keys.items()}

        design = part("design")
        kinds = {"filter": _filter, "run": _rescale, "format": _format, "noise": _noise}
        design |= {key: tuple(make(one) for one in design[key]) for key, make in kinds.items()}
        highest = design["functions"] // 2 + design["power"] // 2
        circle = circle_of(design["hop"], highest, design["fine"])
        tables = WeakDesignQ31(model=made.model, circle=circle, units=(), margins={}, **design)
        trust = {"age_max": 0} | part("trust")  # 0: of former logs
        part_of_all = trust.pop("neglected", 0) / 2**30  # of logs before there were other shared errors
        config = WeakConfigQ31(
            design=tables,
            estimator=EstimatorConfigQ31(**part("estimator")),
            trust=TrustConfigQ31(**trust),
            gate=GateConfigQ31(**part("gate")),
            **{
                one.name: _tuples(weak[one.name])
                for one in fields(WeakConfigQ31)
                if one.name in weak and one.name not in ("design", "estimator", "trust", "gate")
            },
        )
        own = weak_q31_of_parts(compiled, made, config, float(weak["sample_rate"]))
        if part_of_all:
            shared = Shared.of_part(compiled, part_of_all).counts(own.parameters.p_bits)
            config = replace(config, trust=replace(config.trust, shared=shared))
            own = replace(own, config=config)
        return cls(rig, own, np.zeros((0, tables.model.samples), np.int32))


def _recording(counts: npt.NDArray[np.int32]) -> str:
    rows = [f"    {{{', '.join(map(str, row))}}}," for row in counts.tolist()]
    return "\n".join(
        [
            "/* Generated by pvid.board.mechanism_board_q31: do not edit. */",
            "#ifndef STREAM_RECORDING_H",
            "#define STREAM_RECORDING_H",
            "",
            "#define STREAM_PUT pvid_put_i32",
            f"#define RECORDED_TICKS {len(counts)}u",
            f"static const int32_t recorded[RECORDED_TICKS][{counts.shape[1]}] = {{",
            *rows,
            "};",
            "",
            "#endif",
            "",
        ]
    )


# ---- the text of the settings: integers, and two reaches that the formats follow from


def _flat(weak: WeakQ31) -> dict[str, Any]:
    config = weak.config
    parts: dict[str, Any] = {
        "estimator": config.estimator,
        "trust": config.trust,
        "gate": config.gate,
        "design": config.design,
    }
    found: dict[str, Any] = {
        "core": "q31",
        "sample_rate": weak.sample_rate,
        "run_s": weak.made.run_s,
        "jet_reach": weak.made.reaches,
    }
    found |= {one.name: getattr(config, one.name) for one in fields(config) if one.name not in (*parts, "causes")}
    for part, owner in parts.items():
        names = (one.name for one in fields(owner) if part != "design" or one.name not in _COMPUTED)
        found |= {f"{part}_{name}": getattr(owner, name) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def _written(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'"{value}"'
        case WeakFilterQ31():
            return _written([value.half, value.down, *value.weights.tolist()])
        case Rescale() | WeakFormatQ31():
            return _written([getattr(value, one.name) for one in fields(value)])
        case WeakNoiseQ31():
            return _written([value.kind, value.power, value.a, value.b, *value.factor])
        case tuple() | list():
            words = [_written(one) for one in value]
            rows = [", ".join(words[k : k + _WIDTH]) for k in range(0, len(words), _WIDTH)]
            together = ",\n".join(rows)
            return f"[{together}]"
        case _:
            return repr(value)


def _refuse_words(value: Any) -> None:
    """TypeError where anything but a number would get into the C that is printed and compiled."""
    if isinstance(value, list):
        for one in value:
            _refuse_words(one)
    elif not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")


def _tuples(value: Any) -> Any:
    return tuple(_tuples(one) for one in value) if isinstance(value, list | tuple) else value


def _filter(given: tuple[int, ...]) -> WeakFilterQ31:
    half, down, *weights = given
    return WeakFilterQ31(half, down, np.array(weights, np.int32))


def _rescale(given: tuple[int, ...]) -> Rescale:
    return Rescale(*given)


def _format(given: tuple[int, ...]) -> WeakFormatQ31:
    return WeakFormatQ31(*given)


def _noise(given: tuple[int, ...]) -> WeakNoiseQ31:
    kind, power, a, b, m, e = given
    return WeakNoiseQ31(kind, power, a, b, (m, e))
