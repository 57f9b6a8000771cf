"""On which side of a jump of a held input the sensors are sampled that jump with it: the recording shows it.

A controller that reads its sensors and then sets its output records the value before the jump; one that sets and then
reads, the value after it; a sensor that averages, one between.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel, Edge
from pvid.model.corners import feedthroughs
from pvid.oracle.weak.choice import basis_of, lengths, made, score_of
from pvid.oracle.weak.front import samples_of, segments_of
from pvid.oracle.weak.identify import ready

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
    sensors = {sensor for sensor, _ in feedthroughs(model)}
    if not sensors:
        return model
    longest = max((part.stop - part.start for part in segments_of(samples_of(model, dict(run)))), default=0)
    basis = basis_of(ready(model), sample_rate)
    designs = [made(basis, window_s=one) for one in lengths(longest, sample_rate)[-_DESIGNS:]]
    chi2: dict[Edge, float] = {}
    for edge in EDGES:
        other = ready(_sampled(model, sensors, edge))
        found = [score_of(other, run, design, None, False) for design in designs]
        if found and all(one is not None for one in found):
            chi2[edge] = float(np.mean([np.log(one.chi2) for one in found if one is not None]))
    best = min(chi2, key=lambda one: chi2[one], default=EDGES[0])
    clear = best in chi2 and chi2[best] < chi2.get(EDGES[0], np.inf) - _CLEAR
    return _sampled(model, sensors, best) if clear else model


def _sampled(model: CompiledModel, sensors: set[str], edge: Edge) -> CompiledModel:
    return replace(
        model, signals=tuple(replace(one, edge=edge) if one.name in sensors else one for one in model.signals)
    )
