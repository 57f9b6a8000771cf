"""The mechanism of a log: as its board named it (frames.Names), or as the model file of its rig describes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.link.names import BoardNames, Quantity
from pvid.rig.former import names_of_former_board

if TYPE_CHECKING:  # they load SymPy
    from pvid.model.compiled import CompiledModel
    from pvid.model.description import Model as Description

Float = npt.NDArray[np.float64]
Errors = dict[str, tuple[float, float]]

# Columns of a log's tables that no sample and no parameter may be called.
TAKEN = frozenset(("t", "tick", "segment", "run", "log_time", "updates", "kappa", "residual", "reason", "standing"))
_MOST_KEPT = 16
_LARGEST = 1e30  # value of a constant


def _none(p: Mapping[str, float], covariance: Float) -> Errors:
    return {}


@dataclass(frozen=True, eq=False)
class LogMechanism:
    """Names and units of what a log contains.

    Raises PvidError where a name is that of another column.

    Attributes
    ----------
    name : of the mechanism
    samples, parameters : of a tick, and of p
    outputs : what follows from p; none where the board alone named them, or a constant that they need is not known
    outputs_at : (p by name, its covariance in that order [n, n]) -> by name of the outputs their values and standard
        errors by the delta method; empty where p is not that of a possible mechanism
    known : values of its constants
    """

    name: str
    samples: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...] = ()
    outputs_at: Callable[[Mapping[str, float], Float], Errors] = _none
    known: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for columns in (self.samples, (*self.answers, *(Quantity(f"{one.name}_se", "") for one in self.answers))):
            called = [one.name for one in columns]
            if len(set(called)) < len(called) or not TAKEN.isdisjoint(called):
                raise PvidError(f"{self.name}: a sample or a parameter has the name of another column")

    @property
    def answers(self) -> tuple[Quantity, ...]:
        """What a view shows, in its order: outputs, then p."""
        return (*self.outputs, *self.parameters)


def mechanism_described(name: str, model: Description | CompiledModel, given: Mapping[str, Any]) -> LogMechanism:
    """The mechanism of a model with these values of its constants, among other keys."""
    values = {one.name: given.get(one.name, None if one.required else one.value) for one in model.knowns}
    known = {k: float(x) for k, x in values.items() if isinstance(x, int | float) and abs(x) <= _LARGEST}
    samples, p, outputs = (
        tuple(Quantity(one.name, one.unit) for one in some) for some in (model.signals, model.unknowns, model.outputs)
    )
    if not outputs or len(known) < len(values):
        return LogMechanism(name, samples, p, known=known)
    return LogMechanism(name, samples, p, outputs, _outputs_of(model, known), known)


def _outputs_of(
    model: Description | CompiledModel, known: Mapping[str, float]
) -> Callable[[Mapping[str, float], Float], Errors]:
    """See LogMechanism.outputs_at."""
    from pvid.model.evaluation import with_slopes

    used = [one for one in model.unknowns if any(output.value.has(one.symbol) for output in model.outputs)]
    symbols = [tuple(one.symbol for one in some) for some in (used, model.knowns)]
    function = with_slopes(tuple(one.value for one in model.outputs), *symbols)
    constants = [known[one.name] for one in model.knowns]

    @np.errstate(all="ignore")  # a board may send any number
    def outputs_at(p: Mapping[str, float], covariance: Float) -> Errors:
        if any(one.name not in p or (one.positive and not p[one.name] > 0) for one in used):
            return {}
        found, slope = function(*(np.float64(p[one.name]) for one in used), *constants)
        at, names = np.array(slope, np.float64), list(p)
        if not (np.isfinite(found).all() and np.isfinite(at).all()):
            return {}
        places = [names.index(one.name) for one in used]
        of_p = np.asarray(covariance, np.float64)[np.ix_(places, places)]
        se = np.sqrt(np.einsum("ia,ab,ib->i", at, of_p, at))
        return {one.name: (float(x), float(s)) for one, x, s in zip(model.outputs, found, se, strict=True)}

    return outputs_at


@lru_cache(maxsize=_MOST_KEPT)
def mechanism_named(text: bytes) -> LogMechanism:
    """The mechanism that a board says it is.

    Raises PvidError where the text breaks a rule of link.names, or a name is that of another column.
    """
    names = BoardNames.parse(text)
    return LogMechanism(names.mechanism, names.samples, names.parameters)


UNNAMED = mechanism_named(names_of_former_board().encode())
"""Of a log without a rig whose board named nothing, as those of version 0.1 did."""
