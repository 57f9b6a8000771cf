"""Computations that run away on bad data: what numpy raises then, and the one guard of every check beside the fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from pvid.base.errors import PvidError

# A matrix that is singular or not finite, a division by a sum that vanished, a power that overflowed; or samples that
# do not suffice for what was asked.
FAILURES = (np.linalg.LinAlgError, ArithmeticError, PvidError)

Found = TypeVar("Found")


def attempted(computation: Callable[[], Found]) -> Found | None:
    """What a computation returns; None where its numbers ran away."""
    try:
        return computation()
    except FAILURES:
        return None
