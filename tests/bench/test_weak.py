"""The bench of the weak identifier against the oracle: its short form, and its table."""

import numpy as np
import pytest

from bench import weak
from pvid.sim.simulated_run import PERFECT, SOFT


def test_the_identifier_is_as_accurate_as_the_oracle() -> None:
    """Ratio of the RMS errors over six runs from starts within +-50 %; 20 runs: `pvid bench weak`."""
    case = weak.Case("kapitza", SOFT)
    counted = []
    found = weak.errors_of(case, 6, lambda: counted.append(1))
    assert len(counted) == 6 and found.published == (6,)
    # Six runs: errors of 0.15 standard error between the two move a ratio by some 0.15 / sqrt(6).
    assert found.ratios().max() < 1.2
    assert found.ratios(found.from_truth).max() < 1.1
    assert np.sqrt(np.mean(found.apart**2)) < 0.2
    row = weak.row_of(case, found)
    assert len(row) == len(weak.HEADER)
    assert row[:5] == ("kapitza", "none", str(found.functions), "6", "6")


def test_mechanisms_with_friction_have_two_cases() -> None:
    assert [one.friction for one in weak.cases(["kapitza", "dc_motor"])] == ["none", "soft", "sharp"]
    assert weak.cases(["dc_motor"])[1].law is PERFECT


def test_ratios_are_by_parameter() -> None:
    mine, oracle = np.array([[3.0, 0.0], [4.0, 2.0]]), np.array([[1.0, 2.0], [7.0, 2.0]])
    one = weak.Errors(mine, oracle, np.zeros((2, 2)), (2,), 12)
    assert one.ratios() == pytest.approx([(25 / 50) ** 0.5, (4 / 8) ** 0.5])
    assert one.ratios(oracle[:, ::-1]) == pytest.approx([(8 / 50) ** 0.5, (50 / 8) ** 0.5])
