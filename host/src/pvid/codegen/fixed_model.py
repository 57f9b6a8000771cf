"""The fixed-point functions of a model: how large their inputs become, and the formats that follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pvid.base.errors import PvidError
from pvid.codegen.c_functions import require_scaled
from pvid.codegen.formats import FixedProgram, Interval, bits_of, bounds_of, fixed
from pvid.codegen.functions import Function, Input, ModelFunctions
from pvid.model.signals import Jet


@dataclass(frozen=True)
class Reaches:
    """What the description does not tell.

    Attributes
    ----------
    bandwidth_hz : of the signals: the nth derivative reaches (2 pi bandwidth)^n times the signal [Hz]
    window_s : length of a window, for integrals since its start [s]
    run_s : length of a run, for integrals since its start [s]
    of : input's name -> its largest absolute value, in place of these rules
    """

    bandwidth_hz: float = 10.0
    window_s: float = 2.0
    run_s: float = 3600.0
    of: Mapping[str, float] = field(default_factory=dict)


def reaches_of(functions: ModelFunctions, given: Reaches) -> list[float]:
    """Largest absolute value of each input of channels.

    Raises PvidError for a name that is no input, or a reach that is not positive.
    """
    names = [one.name for one in functions.inputs]
    for name, reach in given.of.items():
        if name not in names:
            raise PvidError(f"{functions.name} has no input {name}: its inputs are {', '.join(names)}")
        if not 0 < reach < math.inf:
            raise PvidError(f"the reach of {name} must be positive, not {reach}")
    found = [given.of.get(one.name, _plain(one, given)) for one in functions.inputs]
    folded = [k for k, one in enumerate(functions.inputs) if one.fold]
    if folded:
        bounds = bounds_of(functions.integrands.program, [symmetric(one) for one in found], functions.name)
        for k, place in zip(folded, functions.integrands.program.results, strict=True):
            one = functions.inputs[k]
            length = given.run_s if one.since_start else given.window_s
            size = max(map(abs, bounds[place])) * length**one.fold / math.factorial(one.fold)
            found[k] = given.of.get(one.name, size)
    return found


def _plain(one: Input, given: Reaches) -> float:
    """Of an input that is no integral."""
    if isinstance(one.symbol, Jet):
        return one.reach * (2 * math.pi * given.bandwidth_hz) ** one.symbol.order
    return given.window_s if one.unit == "s" else one.reach


def symmetric(reach: float) -> Interval:
    """-reach..reach."""
    return -reach, reach


@dataclass(frozen=True)
class FixedFunction:
    """A function of the inputs in int32."""

    function: Function
    made: FixedProgram


@dataclass(frozen=True)
class FixedModel:
    """What is generated in integers.

    Attributes
    ----------
    functions : of the model
    reaches : largest absolute value of each input
    input_bits : format of each input
    limits : largest absolute integer of each input; beyond it the functions refuse
    of_inputs : integrands (where there are any) and channels
    """

    functions: ModelFunctions
    reaches: tuple[float, ...]
    input_bits: tuple[int, ...]
    limits: tuple[int, ...]
    of_inputs: tuple[FixedFunction, ...]

    @property
    def of_parameters(self) -> tuple[Function, Function]:
        """theta and jacobian, in numbers of any size."""
        return self.functions.theta, self.functions.jacobian


def fixed_model(functions: ModelFunctions, given: Reaches | None = None) -> FixedModel:
    """Formats of all functions from the reaches of the inputs.

    Raises PvidError where fixed point cannot compute a function: a divisor that may be 0, a square root, a value too
    large.
    """
    functions.model.refuse_constraints("fixed point")
    reaches = reaches_of(functions, given or Reaches())
    bounds = [symmetric(one) for one in reaches]
    bits = [bits_of(one) for one in bounds]
    of_inputs = [
        FixedFunction(one, fixed(one.program, bounds, f"{functions.name}, {one.name}"))
        for one in (functions.integrands, functions.channels)
        if one.labels
    ]
    for one in (functions.theta, functions.jacobian):
        require_scaled(one.program, f"{functions.name}, {one.name}")
    limits = [math.floor(reach * 2.0**places) for reach, places in zip(reaches, bits, strict=True)]
    return FixedModel(functions, tuple(reaches), tuple(bits), tuple(limits), tuple(of_inputs))
