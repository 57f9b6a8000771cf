"""The strong form's core in every build against its twin, some estimators at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native
from pvid.run.compare import first_difference
from pvid.settings.f32 import EstimatorConfig, StrongConfig
from pvid.twin.strong import StrongTwin


def strong_lanes(
    config: StrongConfig,
    lanes: Sequence[EstimatorConfig],
    phi: npt.NDArray[Any],
    y: npt.NDArray[Any],
    matrix: Mapping[str, Native],
) -> list[tuple[dict[str, int], npt.NDArray[np.uint8]]]:
    """Asserts that every build has the twin's bits and counters in every lane; returns counters and reasons a lane."""
    twin = StrongTwin(config, list(lanes))
    expected = twin.run(phi, y)
    found = []
    for lane, estimator in enumerate(lanes):
        counters = {name: int(of[lane]) for name, of in twin.estimator.counters.items()}
        for native in matrix.values():
            core = native.identifier(replace(config, estimator=estimator))
            record = core.run(phi, y, hashes=False)
            assert first_difference(record, expected.lane(lane)) is None, native.build
            assert core.counters == counters
        found.append((counters, expected.reason[:, lane]))
    return found
