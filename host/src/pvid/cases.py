"""One interface to the strong form's identifiers: CASES[form, core], or `case_of` for settings or a rig file.

A case converts a rig file to settings, a run to samples and the core's numbers to SI. It makes the frames of the link,
the twin and the C header of the same settings. Code that depends on form or core belongs here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.link import frames
from pvid.models.registry import DEFAULT
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Core, Form, Law
from pvid.settings.kinds import Settings
from pvid.setup import q31 as fixed
from pvid.setup.f32 import strong_config
from pvid.setup.header import fixed_notes, scale_lines, settings_header
from pvid.setup.ranges_q31 import Beyond, with_ranges_of
from pvid.twin.record import Twin
from pvid.twin.strong import StrongTwin
from pvid.twin.strong_q31 import StrongTwinQ31

Float = npt.NDArray[np.float64]
Samples = npt.NDArray[Any]  # float32 [rad], [m], or int32 counts

# Fields of the settings that a Configure frame has for every parameter.
_PER_PARAMETER = ("start", "start_sd", "lower", "upper")


class HasCase(Protocol):
    """Settings of an identifier, or the `[identifier]` section of a rig file."""

    @property
    def form(self) -> Form: ...
    @property
    def core(self) -> str: ...


class Case(ABC):
    """A form and a core. The two subclasses are the cores; the form is an argument of their constructor.

    Parameters
    ----------
    form
        Which form of the model.
    twin
        The twin's class.
    """

    core: ClassVar[Core]
    sample_type: ClassVar[type[np.generic]]  # of the samples that the core takes
    frame: ClassVar[Any]  # of samples to the board
    configure_frame: ClassVar[Any]
    umbrella: ClassVar[str]  # the header of the whole core
    matrix: ClassVar[str]  # in an estimate: covariance, or correlation beside standard errors
    _single: ClassVar[tuple[str, ...]]  # fields of the estimator's settings in a Configure frame, besides

    def __init__(self, form: Form, twin: type[Any]) -> None:
        self.form = form
        self._twin = twin

    @property
    def numbers(self) -> tuple[frames.Form, frames.Core]:
        """Form and core as a frame numbers them."""
        return frames.Form[self.form.upper()], frames.Core[self.core.upper()]

    # ---- settings

    @abstractmethod
    def settings(self, rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> Settings:
        """Settings for samples at `sample_rate` [Hz]; `start` overrides the rig's nominal p = (w, d1, d2)."""

    @abstractmethod
    def settings_for_run(self, rig: RigFile, run: Run, start: npt.ArrayLike | None = None) -> Settings:
        """Settings for a run; in fixed point with ranges that contain its samples."""

    def twin(self, config: Settings, estimators: Sequence[Any] | None = None) -> Twin:
        """The numpy twin; one lane for each of `estimators`, by default the settings' own."""
        made: Twin = self._twin(config, estimators)
        return made

    @abstractmethod
    def header(self, config: Any, l1: float, name: str, made_by: str) -> str:
        """A C header that defines the settings as `name`, with their tables, for a rod of l1 [m]."""

    def facts(self, config: Any) -> list[str]:
        """What a user should know of the settings; none in float32."""
        return []

    def sizes(self, config: Any) -> dict[str, str]:
        """Macros of pvid/config.h that the settings need."""
        return {"PVID_MAX_WINDOW": str(max(config.bank.memory, 5))}

    def alike_from(self, ticks: int) -> int:
        """First tick of `ticks` that counts in the mean cost of a tick: from there on windows are full."""
        return min(500, ticks // 2)

    @property
    def hash_function(self) -> str:
        """The function in C that continues the running hash over the estimator."""
        return f"pvid_fnv_strong_{self.core}"

    @property
    @abstractmethod
    def assess_call(self) -> tuple[str, str]:
        """The function in C that assesses the estimator, and what of `identifier` it takes."""

    # ---- samples

    @abstractmethod
    def samples(self, rig: RigFile, run: Run) -> tuple[Samples, Samples]:
        """phi and y [ticks] of a run as the core takes them."""

    @abstractmethod
    def from_counts(self, counts: npt.NDArray[np.integer], lsb: tuple[float, float]) -> tuple[Samples, Samples]:
        """The same from counts of a board's sensors [n, 2]; `lsb`: one count [rad], [m]."""

    def with_ranges(self, rig: RigFile, run: Run) -> RigFile:
        """The rig file with the ranges of the fixed-point core for a run; other cores have none."""
        return rig

    # ---- estimates

    @abstractmethod
    def units(self, config: Any) -> Float:
        """One unit of each p in SI [n_p]."""

    @abstractmethod
    def p_of(self, config: Any, p: npt.ArrayLike) -> Float:
        """p in SI from the core's numbers [..., n_p]."""

    @abstractmethod
    def se_of(self, config: Any, se: npt.ArrayLike) -> Float:
        """Standard errors in SI likewise."""

    @abstractmethod
    def covariance_of(self, config: Any, estimate: npt.NDArray[np.void]) -> Float:
        """Covariance of p in SI [..., n_p, n_p] from estimates of the core."""

    @abstractmethod
    def kappa_of(self, estimate: npt.NDArray[np.void]) -> Float:
        """kappa of estimates."""

    def beyond(self, config: Any, phi: Samples, y: Samples) -> Beyond | None:
        """Samples beyond the core's ranges; None in a core without ranges."""
        return None

    # ---- frames

    def configure(self, config: Any, **common: Any) -> frames.Configuration:
        """The Configure frame of the settings, with the fields `common` to both cores."""
        estimator = config.estimator
        given = {name: getattr(estimator, name) for name in ("divider", *self._single)}
        places = {name: _places(getattr(estimator, name)) for name in _PER_PARAMETER}
        made: frames.Configuration = self.configure_frame(**common, **given, **places, **self._offsets(config))
        return made

    def configured(self, config: Any, frame: frames.Configuration) -> Settings:
        """The settings with the values of a Configure frame."""
        if not isinstance(frame, self.configure_frame):
            raise PvidError("the board's image contains another core than the rig file sets")
        n_p = len(config.estimator.start)
        given = {name: getattr(frame, name) for name in ("divider", *self._single)}
        places = {name: self._array(getattr(frame, name)[:n_p]) for name in _PER_PARAMETER}
        return self._with(config, {**given, **places}, {name: getattr(frame, name) for name in self._offsets(config)})

    def shared(self, config: Any) -> Settings:
        """The settings of an image: neutral values for the fields of a Configure frame."""
        ones = self._array((1,) * len(config.estimator.start))
        neutral = {"divider": 1, "row_sd": 1, **dict.fromkeys(_PER_PARAMETER, ones), **self._neutral}
        return self._with(config, neutral, dict.fromkeys(self._offsets(config), 0))

    _neutral: ClassVar[Mapping[str, Any]]

    @staticmethod
    @abstractmethod
    def _array(values: tuple[Any, ...]) -> Any: ...

    def _offsets(self, config: Any) -> dict[str, int]:
        return {}

    def _with(self, config: Any, estimator: Mapping[str, Any], own: Mapping[str, Any]) -> Settings:
        made: Settings = replace(config, estimator=replace(config.estimator, **estimator), **own)
        return made


class _Float(Case):
    core = "f32"
    sample_type = np.float32
    frame = frames.Sample
    configure_frame = frames.Configure
    umbrella = "pvid/pvid.h"
    matrix = "covariance"
    _single = ("row_sd", "forgetting_s", "feedback_hz", "law")
    _neutral: ClassVar[Mapping[str, Any]] = {"forgetting_s": 0.0, "feedback_hz": 0.0, "law": Law.STATIONARY}

    def settings(self, rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> Settings:
        return strong_config(rig, sample_rate, start)

    def settings_for_run(self, rig: RigFile, run: Run, start: npt.ArrayLike | None = None) -> Settings:
        return strong_config(rig, run.sample_rate, start)

    def header(self, config: Any, l1: float, name: str, made_by: str) -> str:
        return settings_header(config, name, made_by, self.umbrella)

    @property
    def assess_call(self) -> tuple[str, str]:
        return "pvid_strong_assess_f32", "identifier"

    def samples(self, rig: RigFile, run: Run) -> tuple[Samples, Samples]:
        return run.phi, run.y

    def from_counts(self, counts: npt.NDArray[np.integer], lsb: tuple[float, float]) -> tuple[Samples, Samples]:
        values = counts.astype(np.float32) * np.array(lsb, np.float32)
        return values[:, 0], values[:, 1]

    def units(self, config: Any) -> Float:
        return np.ones(len(config.estimator.start))

    def p_of(self, config: Any, p: npt.ArrayLike) -> Float:
        return np.asarray(p, np.float64)

    def se_of(self, config: Any, se: npt.ArrayLike) -> Float:
        return np.asarray(se, np.float64)

    def covariance_of(self, config: Any, estimate: npt.NDArray[np.void]) -> Float:
        n_p = len(config.estimator.start)
        return estimate["covariance"][..., :n_p, :n_p].astype(np.float64)

    def kappa_of(self, estimate: npt.NDArray[np.void]) -> Float:
        return estimate["kappa"].astype(np.float64)

    @staticmethod
    def _array(values: tuple[Any, ...]) -> Any:
        return np.array(values, np.float32)

    def _with(self, config: Any, estimator: Mapping[str, Any], own: Mapping[str, Any]) -> Settings:
        law = estimator["law"]
        if law not in list(Law):
            raise PvidError(f"the board was configured with law {law}, which does not exist")
        return super()._with(config, {**estimator, "law": Law(law), "row_sd": float(estimator["row_sd"])}, own)


class _Fixed(Case):
    core = "q31"
    sample_type = np.int32
    frame = frames.Count
    configure_frame = frames.ConfigureQ31
    umbrella = "pvid/pvid_q31.h"
    matrix = "correlation"
    _single = ("row_sd", "forgetting_groups", "gain")
    _neutral: ClassVar[Mapping[str, Any]] = {"forgetting_groups": 0, "gain": 2**30}

    def settings(self, rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> Settings:
        return fixed.strong_config_q31(rig, sample_rate, start)

    def settings_for_run(self, rig: RigFile, run: Run, start: npt.ArrayLike | None = None) -> Settings:
        return fixed.config_for_run(with_ranges_of(rig, run), run, start)

    def with_ranges(self, rig: RigFile, run: Run) -> RigFile:
        return with_ranges_of(rig, run)

    def header(self, config: Any, l1: float, name: str, made_by: str) -> str:
        more = scale_lines(config, l1, name)
        return settings_header(config, name, made_by, self.umbrella, fixed_notes(config), more)

    def facts(self, config: Any) -> list[str]:
        spare = ", ".join(f"{name} {bits:.2f}" for name, bits in config.design.margins.items())
        return [f"bits to spare at full scale: {spare}"]

    def samples(self, rig: RigFile, run: Run) -> tuple[Samples, Samples]:
        return fixed.counts_of(rig, run)

    def from_counts(self, counts: npt.NDArray[np.integer], lsb: tuple[float, float]) -> tuple[Samples, Samples]:
        return counts[:, 0].astype(np.int32), counts[:, 1].astype(np.int32)

    def units(self, config: Any) -> Float:
        return fixed.units_of(config)

    def p_of(self, config: Any, p: npt.ArrayLike) -> Float:
        return fixed.p_of(config, p)

    def se_of(self, config: Any, se: npt.ArrayLike) -> Float:
        return fixed.se_of(config, se)

    def covariance_of(self, config: Any, estimate: npt.NDArray[np.void]) -> Float:
        return fixed.covariance_of(config, estimate)

    def kappa_of(self, estimate: npt.NDArray[np.void]) -> Float:
        return np.asarray(estimate["kappa"] / 2**30)

    def beyond(self, config: Any, phi: Samples, y: Samples) -> Beyond | None:
        return fixed.beyond_range(config, phi, y)

    @property
    def assess_call(self) -> tuple[str, str]:
        return f"pvid_{DEFAULT}_estimator_assess_q31", "identifier.estimator"

    @staticmethod
    def _array(values: tuple[Any, ...]) -> Any:
        return tuple(values)

    def _offsets(self, config: Any) -> dict[str, int]:
        return {"phi_offset": config.phi_offset, "y_offset": config.y_offset}


def _places(values: npt.ArrayLike) -> tuple[Any, ...]:
    """The values, padded with zeros to the length of a frame's field."""
    given = np.asarray(values).tolist()
    return tuple([*given, *[type(given[0])(0)] * (frames.MAX_P - len(given))])


CASES: dict[tuple[str, str], Case] = {
    (case.form, case.core): case
    for case in (
        _Float("strong", StrongTwin),
        _Fixed("strong", StrongTwinQ31),
    )
}


def case_of(what: HasCase) -> Case:
    """The case of an identifier's settings, or of a rig file.

    Raises
    ------
    PvidError
        For core f64, which exists in Python only, and for the weak form.
    """
    case = CASES.get((what.form, what.core))
    if case is None:
        raise PvidError(f"the strong form is in the cores f32 and q31, not {what.form} {what.core}")
    return case
