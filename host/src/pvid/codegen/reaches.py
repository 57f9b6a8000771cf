"""How large the inputs of a model's functions become: what fixed-point formats follow from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pvid.base.errors import PvidError
from pvid.codegen.functions import Input, ModelFunctions
from pvid.codegen.intervals import Interval, bounds_of
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

    Raises
    ------
    PvidError
        For a name that is no input, or a reach that is not positive.
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
