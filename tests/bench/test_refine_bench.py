"""The bench of the refinement in its short form: what the table claims, on a few runs."""

from __future__ import annotations

import numpy as np
import pytest

from bench.refine import Case, bound_of, row_of, run_case


@pytest.mark.parametrize("case", [Case(0.3, 14, duration=15.0), Case(0.2, 14, (0.002, 0.0005), 0.001, 15.0)])
def test_the_refinement_reaches_the_bound(case: Case) -> None:
    """Friction and skew included, behind a weak form that knows neither; one run may be thrice the bound off."""
    runs = [run_case(case, seed) for seed in range(2)]
    error = np.array([one.error for one in runs])
    assert np.all(np.abs(error) < 4 * bound_of(case))
    assert np.all(np.abs(error) < 4 * np.array([one.se for one in runs]))
    assert all(one.first < 4.5 for one in runs)
    assert row_of(case, runs)[3] == "2 of 2"


def test_the_bound_shrinks_with_the_encoders_noise() -> None:
    coarse, fine = (bound_of(Case(0.1, bits, duration=5.0)) for bits in (14, 16))
    np.testing.assert_allclose(coarse / fine, 4.0)
