"""Units with a prefix, for any number that a board may send."""

import math

import pytest

from pvid.base.rounding import part_of_one, percent, prefix_of, with_error


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


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (9.50069, 0.0011, ("9.5007", "0.0011")),
        (1.20001164, 8.5e-6, ("1.2000116", "0.0000085")),
        (1.199957e-2, 6.2e-7, ("0.01199957", "0.00000062")),
        (9.9997e-5, 1.3e-8, ("9.9997e-05", "1.3e-08")),
        (1.2, 1e-12, ("1.2000000000000e+00", "1.0e-12")),
        (123456.0, 780.0, ("123460", "780")),
        (1.0, math.nan, ("1", "nan")),
    ],
)
def test_a_value_is_shown_to_the_second_digit_of_its_error(value: float, error: float, shown: tuple[str, str]) -> None:
    assert with_error(value, error) == shown


def test_a_part_beyond_all_measure_has_no_digits() -> None:
    assert (percent(0.00312), percent(0.9999), percent(5.91)) == ("0.31 %", "100 %", "591 %")
    assert percent(1e300) == "more than 10000 %"
    assert (part_of_one(0.99, 3), part_of_one(-3.5, 3), part_of_one(-1e300, 3)) == ("0.990", "-3.500", "below -100")
