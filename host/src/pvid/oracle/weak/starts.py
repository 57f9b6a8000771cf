"""Starts of a search for p about the guesses, for a run whose search from the guesses finds nothing plausible."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import Parameters

_FACTOR = 3.0  # of a positive parameter, either way: a guess of a length may be off by so much
_COUNT = 8

# Steps of an additive sequence with evenly spread points in n dimensions: powers of 1 / g, g^(n + 1) = g + 1.
_ITERATIONS = 40


def starts_about(parameters: Parameters, guess: Float) -> Iterator[Float]:
    """Positive parameters times or over up to 3, spread evenly in their logarithms; the others stay."""
    positive = np.flatnonzero(parameters.positive)
    steps = _steps(max(len(positive), 1))[: len(positive)]
    for k in range(1, _COUNT + 1):
        p = guess.copy()
        p[positive] *= _FACTOR ** (2 * ((0.5 + k * steps) % 1.0) - 1)
        yield p


def _steps(dimensions: int) -> Float:
    g = 2.0
    for _ in range(_ITERATIONS):
        g = (1 + g) ** (1 / (dimensions + 1))
    return np.asarray(g ** -np.arange(1.0, dimensions + 1))
