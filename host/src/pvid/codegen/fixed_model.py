"""The fixed-point functions of a model with their formats."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pvid.codegen.c_q31 import require_scaled
from pvid.codegen.formats import FixedProgram, bits_of, fixed
from pvid.codegen.functions import Function, ModelFunctions
from pvid.codegen.reaches import Reaches, reaches_of, symmetric


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

    Raises
    ------
    PvidError
        Where fixed point cannot compute a function: a divisor that may be 0, a square root, a value too large.
    """
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
