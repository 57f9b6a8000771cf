"""The bench of the refinement in its short form: what the tables claim, on a few runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.refine import HEADER, refine_table, row_of, run_case
from bench.refine_cases import Case, bound_of, bound_of_measured
from bench.refine_imperfect import HEADER as IMPERFECT
from bench.refine_imperfect import Fault, imperfect_table, run_fault
from bench.refine_options import HEADER as OPTIONS
from bench.refine_options import row_of as row_of_options
from bench.refine_step import HEADER as CHANGED
from bench.refine_step import Change, run_change
from bench.refine_step import row_of as row_of_change


@pytest.mark.parametrize("case", [Case(0.3, 14, duration=15.0), Case(0.2, 14, (0.002, 0.0005), 0.001, 15.0)])
def test_the_refinement_reaches_the_bound(case: Case) -> None:
    """Friction and skew included, behind a weak form that knows neither; one run may be thrice the bound off."""
    runs = [run_case(case, seed) for seed in range(2)]
    error = np.array([one.error for one in runs])
    assert np.all(np.abs(error) < 4 * bound_of(case))
    assert np.all(np.abs(error) < 4 * np.array([one.se for one in runs]))
    assert all(one.first < 5.0 for one in runs)
    assert row_of(case, runs)[3] == "2 of 2"


def test_the_steps_of_the_motion_leave_no_bias() -> None:
    """Without the correction to order 8 the errors are 4.5 times the bound, three times the standard errors."""
    case = Case(0.3, 16, exact_drive=True)
    runs = [run_case(case, seed) for seed in range(4)]
    error = np.sqrt(np.mean([one.error**2 for one in runs], axis=0))
    assert np.all(error < 2.5 * bound_of(case))
    assert np.median([one.level for one in runs]) < 1.5


def test_the_bound_shrinks_with_the_encoders_noise() -> None:
    coarse, fine = (bound_of(Case(0.1, bits, duration=5.0)) for bits in (14, 16))
    np.testing.assert_allclose(coarse / fine, 4.0)


def test_the_noise_of_the_drives_sensor_raises_the_bound_of_a_fine_encoder() -> None:
    """A coarse encoder hides it; an exact drive has none."""
    ratio = [
        bound_of_measured(case) / bound_of(case)
        for case in (
            Case(0.3, bits, duration=10.0, exact_drive=exact) for bits, exact in ((10, False), (16, False), (16, True))
        )
    ]
    assert np.all(ratio[0] > 1.0) and np.all(ratio[0] < 1.01)
    assert np.all(ratio[1] > 1.15)
    assert np.all(ratio[2] == 1.0)


def test_the_standard_errors_hold_where_the_motion_has_decayed() -> None:
    """The first blocks, with the largest motion and so the most noise of the drive, have all the information; the
    scatter of the last ones alone gave errors of 1.4 standard errors (RMS)."""
    runs = [run_case(Case(0.2, 16, (0.002, 0.0005)), seed) for seed in range(40)]
    assert np.sqrt(np.mean([(one.error / one.se) ** 2 for one in runs])) < 1.25


def test_the_tables_have_a_cell_for_each_column() -> None:
    steps: list[None] = []
    rows = refine_table(2, lambda: steps.append(None), [Case(0.3, 12, duration=6.0, exact_drive=True)])
    wrong = imperfect_table(2, lambda: steps.append(None), [Fault(0.1, dry=1e-3, duration=6.0)])
    assert [len(one) for one in (*rows, *wrong)] == [len(HEADER), len(IMPERFECT)]
    assert rows[0][2] == "exact drive" and wrong[0][1:3] == ("dry friction 0.001 g l2", "0 of 2")
    assert len(steps) == 4


@pytest.mark.parametrize("fault", [Fault(0.1, dry=1e-4), Fault(0.3, dry=3e-4), Fault(0.1, backlash=0.5), Fault(0.3)])
def test_what_the_equations_lack_is_in_the_standard_errors(fault: Fault) -> None:
    """The residuals alone leave dry friction 6 to 15 standard errors off, from the first seconds on."""
    for seed in range(2):
        found = run_fault(fault, seed)
        assert len(found.error)
        assert np.abs(found.error / found.se).max() < 4.5
        assert not found.confidently_wrong


@pytest.mark.parametrize(
    "fault",
    [
        Fault(0.1, dry=1e-3, options=("dry_friction",)),
        Fault(0.3, options=("dry_friction",)),
        Fault(0.2, slant=0.03, options=("slant",)),
        Fault(0.2, dry=3e-4, slant=0.03, options=("dry_friction", "slant")),
    ],
)
def test_options_refine_what_the_equations_lack_without_them(fault: Fault) -> None:
    runs = [run_fault(fault, seed) for seed in range(3)]
    for one in runs:
        assert len(one.error) and one.available > 0.7 and not one.confidently_wrong
        assert np.abs(one.error / one.se).max() < 4.0
        if fault.dry:
            np.testing.assert_allclose([one.extras["f1"], one.extras["f2"]], fault.dry * 1.14 / 0.3**2, rtol=0.04)
        if fault.slant:
            assert abs(one.extras["slant"] - np.sin(fault.slant)) < 1e-4
    assert len(row_of_options(fault, runs)) == len(OPTIONS)
    bare = replace(fault, options=())
    if fault.slant or fault.dry == 1e-3:
        assert not len(run_fault(bare, 0).error)


@pytest.mark.parametrize("what", ["g", "l2"])
def test_a_changed_mechanism_is_followed_within_the_time_of_forgetting_or_a_little_more(what: str) -> None:
    """With three times the patience it takes 12 s and more."""
    change = Change(0.2, what, duration=40.0)
    runs = [run_change(change, seed) for seed in range(3)]
    assert np.median([one.published for one in runs]) < change.forgetting_s
    assert all(one.published < 13.0 and one.error < 0.005 for one in runs)
    assert run_change(change, 0, patience_s=3 * change.forgetting_s).published > 11.0
    assert len(row_of_change(change, runs)) == len(CHANGED)


def test_the_gain_of_the_drive_is_in_the_standard_errors() -> None:
    """w, d1, d2 err by one, minus one, minus two times the gain's error."""
    found = run_fault(Fault(0.3, gain=0.004, duration=12.0), 0)
    np.testing.assert_allclose(found.error[-1], [0.004, -0.004, -0.008], rtol=0.1)
    assert np.all(np.abs(found.error[-1] / found.se[-1]) < 1.3)


def test_disturbances_leave_nothing_that_is_not_finite_and_nothing_confidently_wrong() -> None:
    """Two minutes of outliers, missing and stuck samples, spikes of the drive and jumps of the encoder's zero."""
    for seed in range(2):
        found = run_fault(Fault(0.3, disturbed=True, duration=120.0), seed)
        assert np.isfinite(found.error).all() and np.isfinite(found.se).all() and np.isfinite(found.clash)
        assert not found.confidently_wrong
        assert np.abs(found.error[-1]).max() < 2e-3


def test_without_the_3_s_of_its_search_the_bound_with_friction_is_48_percent_larger() -> None:
    case = Case(0.3, 14, (0.002, 0.0005))
    np.testing.assert_allclose(bound_of(case, 3.0) / bound_of(case), 1.48, atol=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("case", "ratio"), [(Case(0.3, 14, (0.002, 0.0005)), 1.85), (Case(0.2, 16, (0.002, 0.0005)), 1.75)]
)
def test_with_the_drives_sensor_it_is_another_quarter_larger(case: Case, ratio: float) -> None:
    np.testing.assert_allclose(bound_of_measured(case, 3.0) / bound_of(case), ratio, atol=0.02)
