"""The mechanism of a log by what the board said about it (frames.Names), where no rig file names it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.link.names import BoardNames, names_of
from pvid.models.model import Channel, Constants, Mechanism, Model, Parameter
from pvid.models.registry import MODELS

# Columns of a log's tables that no sample and no parameter may be called.
TAKEN = frozenset(("t", "tick", "segment", "run", "log_time", "updates", "kappa", "residual", "reason"))
_MOST_KEPT = 16


@lru_cache(maxsize=_MOST_KEPT)
def mechanism_of(text: bytes) -> Mechanism:
    """The mechanism that a board says it is.

    Raises
    ------
    PvidError
        Where the text breaks a rule of link.names, or a name is that of another column.
    """
    names = BoardNames.parse(text)
    known = MODELS.get(names.mechanism)
    if known is not None and _is(names, names_of(known)):
        return Mechanism(known)
    for columns in (names.samples, (*names.parameters, *((f"{name}_se", "") for name, _ in names.parameters))):
        called = [name for name, _ in columns]
        if len(set(called)) < len(called) or not TAKEN.isdisjoint(called):
            raise PvidError(f"{names.mechanism}: a sample or a parameter has the name of another column")
    return Mechanism(_model(names))


def _is(names: BoardNames, known: BoardNames) -> bool:
    """Whether a board has the samples of a mechanism, in any order, and its first parameters."""
    return sorted(names.samples) == sorted(known.samples) and (
        names.parameters == known.parameters[: len(names.parameters)]
    )


def _model(names: BoardNames) -> Model:
    """With nothing physical that would follow from p: all of p is published."""

    def none(p: npt.ArrayLike, constants: Constants) -> npt.NDArray[np.float64]:
        return np.zeros((*np.asarray(p).shape[:-1], 0))

    return Model(
        name=names.mechanism,
        title=names.mechanism,
        channels=tuple(Channel(name, unit, name, short=name) for name, unit in names.samples),
        constants=(),
        parameters=tuple(Parameter(name, unit, "parameter") for name, unit in names.parameters),
        physical=(),
        physical_of=none,
        gradient_of=none,
        mapped_of=none,
        is_plausible=lambda p: True,
    )
