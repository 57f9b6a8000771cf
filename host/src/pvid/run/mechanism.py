"""Identification of any mechanism with a compiled model, in float64 (pvid.oracle.fourier)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Output
from pvid.models.mechanisms import compiled_of
from pvid.models.model import Channel
from pvid.oracle.fourier.errors import uncertainty
from pvid.oracle.fourier.identify import Identified
from pvid.oracle.fourier.identify import identify as identified_by
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Value:
    """A parameter, or what follows from p: its value and standard error; None where it is not identified."""

    unit: str
    value: float | None
    se: float | None


@dataclass(frozen=True, eq=False)
class MechanismAnswer:
    """An identification of a recording.

    Attributes
    ----------
    model : with the values of the rig file
    found : estimate and verdict
    values : by name: outputs of the model, then p
    recording : the samples
    """

    model: CompiledModel
    found: Identified
    values: Mapping[str, Value]
    recording: Recording

    @property
    def identified(self) -> bool:
        """Whether every parameter is."""
        return self.found.verdict.identified

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        found = self.found
        parameters = {name: {"value": one.value, "se": one.se, "unit": one.unit} for name, one in self.values.items()}
        return {
            "identified": self.identified,
            "status": found.verdict.status,
            "warning": found.verdict.warning,
            "reasons": {one.name: one.text for one in found.verdict.reasons},
            "parameters": parameters,
            "chi2": found.chi2,
            "r2": found.r2,
            "window_s": found.design.window_s,
            "windows": len(found.times),
            "input": list(self.recording.notes),
            "samples": len(self.recording),
            "model": self.model.name,
            "core": "f64",
            "form": "weak",
        }


def channels_of(model: CompiledModel) -> tuple[Channel, ...]:
    """The signals of a model as channels of a recording; a column's name may carry a unit behind the signal's."""
    return tuple(
        Channel(one.name, one.unit, one.name, usual_names=rf"^{re.escape(one.name)}([\s_(\[].*)?$")
        for one in model.signals
    )


def model_of(rig: MechanismRig) -> CompiledModel:
    """The compiled model with the values of a rig."""
    return rig.applied(compiled_of(rig.model))


def identify_mechanism(recording: Recording, model: CompiledModel) -> MechanismAnswer:
    """Parameters of a mechanism from a recording without missing samples.

    Raises
    ------
    PvidError
        When the recording is too short, or holds a signal beyond all reason.
    """
    _refuse_constant(recording, model)
    found = identified_by(model, recording.signals, recording.sample_rate)
    return MechanismAnswer(model, found, _values(model, found), recording)


def _refuse_constant(recording: Recording, model: CompiledModel) -> None:
    """A sensor that never moves is dead or not connected."""
    for one in model.signals:
        if one.kind == "sensor" and np.ptp(recording.signals[one.name]) == 0:
            raise PvidError(f"{one.name} has the same value in all {len(recording)} samples: is the sensor connected?")


def _values(model: CompiledModel, found: Identified) -> dict[str, Value]:
    def shown(unit: str, value: float, se: float) -> Value:
        return Value(unit, value, se) if found.verdict.identified else Value(unit, None, None)

    values = {one.name: shown(one.unit, *_output(model, found, one)) for one in model.outputs}
    for one, p, se in zip(model.unknowns, found.p, found.se, strict=True):
        values[one.name] = shown(one.unit, float(p), float(se))
    return values


def _output(model: CompiledModel, found: Identified, output: Output) -> tuple[float, float]:
    """Value and standard error by the delta method; NaN where it does not exist at p."""
    value = model.with_knowns(output.value)
    gradient = sp.lambdify(model.p, [value, *(value.diff(symbol) for symbol in model.p)], "numpy")
    with np.errstate(all="ignore"):
        at, *slopes = (complex(one) for one in gradient(*found.p.astype(complex)))
    if abs(at.imag) > 0:
        return float("nan"), float("nan")
    covariance = uncertainty(found.fit).covariance
    widened = found.se / np.sqrt(np.diag(covariance))  # to the published standard errors
    slope = np.array(slopes).real * widened
    return at.real, float(np.sqrt(slope @ covariance @ slope))
