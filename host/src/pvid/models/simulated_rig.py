"""What a simulated rig of a mechanism consists of; pvid/models/NAME/rig.py holds one as RIG."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from pvid.base.errors import PvidError
from pvid.models.drive import Drive, Sines


@dataclass(frozen=True)
class Servo:
    """An input that follows from a reference: kp (reference - coordinate) - kd coordinate' - what other states give.

    Attributes
    ----------
    coordinate : name of the signal
    reference : of the coordinate
    kp, kd : gains, in the input's unit per unit of the coordinate and of its rate
    others : gains of other states, as in r (a position) or r_1 (its rate)
    """

    coordinate: str
    reference: Sines
    kp: float
    kd: float
    others: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SimulatedRig:
    """A mechanism with numbers, drives and a start.

    Attributes
    ----------
    model : name of the mechanism
    truth : value of each unknown, and of refined parameters that are not 0
    drive : of each driven signal: a function of time or a servo
    start : initial value by jet, as in a (angle) or a_1 (its rate); 0 where none is given
    whole_start : the same start in the coordinates of the refinement's own equations
    sample_rate : [Hz]
    duration : [s]
    substeps : steps of the integration in a sample
    friction_width : speed over which the sign of a soft friction changes, tanh(v / width), in the unit of the sign's
        argument; 0: there is no friction
    window_s : window of the Cramer-Rao bound and of the design [s]
    design : the rest of a design of the weak form that suits the rig: fields of WeakDesign
    knowns : values that differ from those of the model
    """

    model: str
    truth: Mapping[str, float]
    drive: Mapping[str, Drive | Servo]
    start: Mapping[str, float] = field(default_factory=dict)
    whole_start: Mapping[str, float] = field(default_factory=dict)
    sample_rate: float = 1000.0
    duration: float = 20.0
    substeps: int = 10
    friction_width: float = 0.0
    window_s: float = 1.0
    design: Mapping[str, int] = field(default_factory=dict)
    knowns: Mapping[str, float] = field(default_factory=dict)


def simulated_rig(model: str) -> SimulatedRig:
    """The shipped rig of a mechanism; PvidError where there is none."""
    try:
        rig = importlib.import_module(f"pvid.models.{model}.rig").RIG
    except ModuleNotFoundError as error:
        raise PvidError(f"{model} has no simulated rig") from error
    assert isinstance(rig, SimulatedRig)
    return rig
