"""The rig file of a mechanism that the core has a form of its own for, as that of its description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pvid.base.errors import PvidError
from pvid.rig.file import Identifier, RigFile
from pvid.rig.mechanism_file import OF_THE_IDENTIFIER, MechanismRig

_OF_THE_STRONG_FORM = ("divider", "feedback_hz", "kappa_min")


def described(rig: RigFile) -> MechanismRig:
    """Constants, resolutions, gains and guesses of a rig file in the terms of the mechanism's description.

    The standard deviation of a length is relative there and absolute here; the reading at rest becomes the guess of the
    offset.
    """
    mechanism = rig.mechanism
    model, constants = mechanism.model, dict(mechanism.constants or {})
    guess = mechanism.mapped([getattr(rig.nominal, one) for one in model.physical_names])
    nominal = dict(zip(model.mapped_names, map(float, guess), strict=True))
    if model.offset_name:
        nominal[model.offset_name] = float(rig.sensor.phi_zero)
    sensor = {one.name: {"resolution": float(getattr(rig.sensor, f"{one.name}_lsb"))} for one in model.channels}
    for name in sensor:
        if hasattr(rig.sensor, f"{name}_gain_sd"):
            sensor[name]["gain_sd"] = float(getattr(rig.sensor, f"{name}_gain_sd"))
    given = {key: getattr(rig.identifier, key) for key in OF_THE_IDENTIFIER}
    known_sd = {name: value * float(getattr(rig, f"{name}_sd")) for name, value in constants.items()}
    return MechanismRig(
        rig.model.name,
        rig.sample_rate,
        known={name: float(value) for name, value in constants.items()},
        sensor=sensor,
        nominal=nominal,
        known_sd=known_sd,
        identifier={key: float(value) for key, value in given.items() if value is not None},
        refine={one.name: getattr(rig.refine, one.name) for one in fields(rig.refine)},
        clock_sd=0.0,  # such a file has no key of it
    )


def refuse_strong(rig: RigFile) -> None:
    """PvidError where a rig file asks for what the strong form alone has."""
    if rig.identifier.law != "stationary":
        raise PvidError(f"the weak form has the stationary law alone, not {rig.identifier.law}: use --form strong")
    for key in _OF_THE_STRONG_FORM:
        if getattr(rig.identifier, key) != getattr(Identifier(), key):
            raise PvidError(f"identifier.{key} is of the strong form: leave it out, or use --form strong")


def rig_of_document(document: Mapping[str, Any]) -> MechanismRig | RigFile:
    """The rig of a log: of a file that names a form it is a pendulum's."""
    identifier = document.get("identifier")
    is_pendulums = isinstance(identifier, Mapping) and "form" in identifier
    return RigFile.of_document(document) if is_pendulums else MechanismRig.of_document(document)
