"""Units with a prefix, for any number that a board may send."""

from __future__ import annotations

import math

import pytest

from pvid.base.rounding import prefix_of


@pytest.mark.parametrize(
    ("size", "unit", "shown"),
    [
        (0.0146, "m", ("mm", 1e-3)),
        (12.0, "m", ("m", 1.0)),
        (3e7, "V", ("MV", 1e6)),
        (1e-30, "V", ("nV", 1e-9)),
        (0.0146, "rad", ("rad", 1.0)),
        *((size, "V", ("V", 1.0)) for size in (0.0, math.inf, math.nan)),
    ],
)
def test_a_unit_takes_the_prefix_of_the_largest_number(size: float, unit: str, shown: tuple[str, float]) -> None:
    assert prefix_of(size, unit) == shown
