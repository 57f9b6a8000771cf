"""A board that identifies a mechanism by its printed strong form in float32."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.board.float_board import FloatBoard, recording_header
from pvid.board.stream_image import MOST_TICKS, StreamImage, refuse_slow
from pvid.codegen import files_strong, files_strong_design
from pvid.codegen.strong import StrongFunctions, renamed, strong_functions_of
from pvid.codegen.strong_library import StrongModelIdentifier, sizes_of_strong, strong_native
from pvid.codegen.strong_twin import StrongModelTwin
from pvid.configuration.nominal_run import nominal_run
from pvid.configuration.strong import reference_of, strong_design
from pvid.core.native import Native
from pvid.link.frames import Configuration, Form
from pvid.link.names import BoardNames, Quantity
from pvid.model.strong import strong_form
from pvid.models.mechanisms import constants_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import identify
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.enums import Law
from pvid.settings.parts import EstimatorConfig, GateConfig
from pvid.settings.strong import StrongModelConfig
from pvid.settings.text import TABLE, array_of, part_of, written
from pvid.sim.simulated_run import RigSimulation

_COMMAND = "pvid log"
_OWN = ("sample_rate", "stride", "block", "exact_every", "row_sd", "weights")


@dataclass(frozen=True, eq=False)
class StrongBoard(FloatBoard):
    """What a stream image of the strong form is made for; it has no second stage.

    Attributes
    ----------
    strong : functions of the strong form, named NAME_strong
    """

    form = Form.STRONG
    config: StrongModelConfig
    strong: StrongFunctions

    @classmethod
    def of_recording(cls, rig: MechanismRig, recording: Recording, reference: Float | None = None) -> StrongBoard:
        """With the window and settings that a recording of the rig asks for; the board's sensors read it.

        Raises PvidError when the recording is too short, or the strong form of the model needs what the core does not
        have.

        Parameters
        ----------
        reference : the truth of a simulation [n_p]; None: the weak form's estimate
        """
        recording.refuse_damaged()
        whole = recording.whole()
        compiled = rig.compiled()
        if reference is None:
            reference = reference_of(attempted(lambda: identify(compiled, whole.run, whole.sample_rate)))
        made = strong_design(compiled, whole, reference=reference)
        return cls(rig, compiled, made.config, made.samples[:MOST_TICKS], made.strong)

    @classmethod
    def of_shipped_rig(cls, name: str) -> StrongBoard:
        """That of a shipped mechanism, whose sensors read a simulation; raises as `of_recording`."""
        simulated = simulated_rig(name)
        rig = MechanismRig(name, simulated.sample_rate, known=constants_of(name, simulated.knowns))
        simulation = RigSimulation.of(rig.compiled(), simulated)
        run = simulation.run()
        return cls.of_recording(rig, Recording(run.pop("t"), run, simulated.sample_rate), simulation.truth)

    @classmethod
    def of_guess(cls, rig: MechanismRig) -> StrongBoard:
        """With a design for the guess of a rig; an emulated board's sensors read a simulation of it.

        Raises PvidError where there is no such simulation (see `nominal_run`), and as `of_recording`.
        """
        nominal = nominal_run(rig)
        return cls.of_recording(rig, nominal.recording, nominal.p)

    def __post_init__(self) -> None:
        refuse_slow(self.config.sample_rate)

    @property
    def names(self) -> BoardNames:
        """What the board says about itself."""
        samples = tuple(Quantity(one.name, one.unit) for one in self.strong.signals)
        parameters = tuple(Quantity(one.name, one.unit) for one in self.compiled.unknowns)
        return BoardNames(self.compiled.name, samples, parameters)

    @property
    def stream_image(self) -> StreamImage:
        """Headers, generated C and sizes."""
        name = self.strong.functions.name
        code = dict(files_strong.files_of(self.strong, _COMMAND))
        code["stream_tables.h"] = files_strong_design.header(self.strong, self._shared, _COMMAND)
        return StreamImage.made(
            "strong",
            "f32",
            own=[
                f"#define STREAM_TYPE {name}_f32",
                f"#define STREAM_CONFIG_TYPE {name}_config_f32",
                f"#define STREAM_CONFIG {name}_config",
                f"#define STREAM_NAME(verb) {name}_##verb##_f32",
            ],
            names=self.names,
            sample_rate=self.sample_rate,
            units=["1.0f"] * len(self.compiled.unknowns),
            code=code,
            recording=recording_header(self.recording),
            sizes=sizes_of_strong(self.strong, self.config),
        )

    def twin_of(self, frame: Configuration) -> StrongModelTwin:
        """The twin with the values of a Configure frame; raises as `configured`."""
        return StrongModelTwin(self.strong, self.configured(frame))

    def core_of(self, frame: Configuration) -> StrongModelIdentifier:
        """The core, compiled on this machine, with the values of a Configure frame; raises as `configured`, and where
        there is no compiler."""
        config = self.configured(frame)
        return strong_native(self.strong, config).identifier_of(config)

    def hashes(self, _: Native, *signals: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the core on this machine [ticks]."""
        identifier = strong_native(self.strong, self.config).identifier_of(self.config)
        return identifier.run_samples(self.readings(*signals), sums=False).hash

    def text(self) -> str:
        """The rig file with the identifier's settings, for a log; `board_of` gives the same board back."""
        own = {name: getattr(self.config, name) for name in _OWN} | {"weights": self.config.weights.ravel()}
        own |= {} if self.config.shared is None else {"shared": self.config.shared}
        for part in ("estimator", "gate"):
            settings = getattr(self.config, part)
            own |= {f"{part}_{one.name}": getattr(settings, one.name) for one in fields(settings)}
        lines = [f"{name} = {written(value)}" for name, value in own.items()]
        return "\n".join([self.rig.text(), f"[{TABLE}]", 'form = "strong"', *lines, ""])

    @classmethod
    def of_tables(cls, rig: MechanismRig, settings: Mapping[str, Any]) -> StrongBoard:
        """From the rig and the table of settings in the text of a log.

        Raises KeyError, TypeError, ValueError where it is damaged.
        """
        compiled = rig.compiled()
        strong = renamed(strong_functions_of(strong_form(compiled)))
        own = {name: settings[name] for name in _OWN}
        given = part_of(settings, "estimator")
        arrays: dict[str, Any] = {
            name: array_of(value) if isinstance(value, list) else value for name, value in given.items()
        }
        config = StrongModelConfig(
            **{**own, "row_sd": tuple(own["row_sd"]), "weights": array_of(own["weights"]).reshape(5, -1)},
            estimator=EstimatorConfig(**{**arrays, "law": Law(given["law"])}),
            gate=GateConfig(**part_of(settings, "gate")),
            shared=array_of(settings["shared"]) if "shared" in settings else None,
        )
        return cls(rig, compiled, config, np.zeros((0, len(strong.signals)), np.float32), strong)
