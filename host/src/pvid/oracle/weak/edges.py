"""On which side of a jump of a held input the sensors are sampled that jump with it: the recording shows it.

A controller that reads its sensors and then sets its output records the value before the jump; one that sets and then
reads, the value after it; a sensor that averages, one between.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel, Edge
from pvid.model.corners import feedthroughs
from pvid.oracle.weak.choice import basis_of, lengths, made, score_of
from pvid.oracle.weak.front import samples_of, segments_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import ready

EDGES: tuple[Edge, ...] = ("between", "before", "after")
_DESIGNS = 3  # the shortest windows: half a sample is the most in them
_CLEAR = 0.02  # difference of the mean logarithm of chi^2


def with_edges(model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float) -> CompiledModel:
    """The model with the side of the jumps on which its sensors are sampled: that of the least chi^2.

    Parameters
    ----------
    run : name -> samples [n]
    sample_rate : [Hz]

    Cost: nine fits where a sensor jumps with a held input; nothing elsewhere.
    """
    sensors = _jumping(model)
    sides = _sides(model, sensors, run, sample_rate)
    best = min(sides, key=lambda one: sides[one].chi2, default=EDGES[0])
    least = sides[EDGES[0]].chi2 if EDGES[0] in sides else np.inf
    return _sampled(model, sensors, best) if best in sides and sides[best].chi2 < least - _CLEAR else model


def other_side(model: CompiledModel, run: Mapping[str, npt.ArrayLike], sample_rate: float) -> Float | None:
    """What p moves by to another side of the jumps that the recording does not exclude [n_p]; None: no sensor jumps.

    Parameters
    ----------
    model, run, sample_rate : those that `with_edges` gave and got

    Cost: that of `with_edges`; next to nothing behind it, whose scores are kept.
    """
    sensors = _jumping(model)
    sides = _sides(model, sensors, run, sample_rate)
    own = sides.get(model.signal(sensors[0]).edge) if sensors else None
    if own is None:
        return None
    others = [own.p, *(one.p for one in sides.values() if one.chi2 < own.chi2 + _CLEAR)]
    moved = np.max(np.abs(others - own.p), axis=0)
    return np.where(np.isfinite(moved), moved, 0.0)


@dataclass(frozen=True)
class _Side:
    """Mean over the shortest windows of the logarithm of chi^2, and of p [n_p]."""

    chi2: float
    p: Float


def _sides(
    model: CompiledModel, sensors: Sequence[str], run: Mapping[str, npt.ArrayLike], sample_rate: float
) -> dict[Edge, _Side]:
    """Those that have an estimate, of the sensors that jump with a held input; none where there are none."""
    if not sensors:
        return {}
    longest = max((part.stop - part.start for part in segments_of(samples_of(model, dict(run)))), default=0)
    basis = basis_of(ready(model), sample_rate)
    designs = [made(basis, window_s=one) for one in lengths(longest, sample_rate)[-_DESIGNS:]]
    sides: dict[Edge, _Side] = {}
    for edge in EDGES:
        other = ready(_sampled(model, sensors, edge))
        scores = [score_of(other, run, design, None, False) for design in designs]
        found = [one for one in scores if one is not None]
        if found and len(found) == len(scores):
            means = np.mean([np.log(one.chi2) for one in found]), np.mean([one.p for one in found], axis=0)
            sides[edge] = _Side(float(means[0]), np.asarray(means[1]))
    return sides


def _jumping(model: CompiledModel) -> list[str]:
    """Sensors that jump with a held input."""
    return list(dict.fromkeys(sensor for sensor, _ in feedthroughs(model)))


def _sampled(model: CompiledModel, sensors: Sequence[str], edge: Edge) -> CompiledModel:
    return replace(
        model, signals=tuple(replace(one, edge=edge) if one.name in sensors else one for one in model.signals)
    )
