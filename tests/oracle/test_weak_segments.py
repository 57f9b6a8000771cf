"""Segments between missing samples are runs of their own, and are identified together."""

import numpy as np
import numpy.typing as npt
import pytest
from test_weak_identify import DESIGNS, SHARP, simulation

from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.choice import ranked
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.rows import WeakRows
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]


def with_gaps(run: dict[str, Float], *gaps: slice) -> dict[str, Float]:
    out = {name: np.array(x, np.float64) for name, x in run.items()}
    for gap in gaps:
        for x in out.values():
            x[gap] = np.nan
    return out


@pytest.mark.parametrize("name", ["cart_pendulum", "rigid_body", "dc_motor"])
def test_rows_of_segments_are_those_of_each_alone(name: str) -> None:
    """Sums, integrals, signs, covariances: nothing reaches across a gap."""
    model, design = ready(compiled_of(name)), DESIGNS[name]
    run = simulation(name).run(1)
    n = len(next(iter(run.values())))
    parts = [slice(0, n // 2 - 10), slice(n // 2 + 33, n)]
    rows = WeakRows.of(model, with_gaps(run, slice(n // 2 - 10, n // 2 + 33)), design)
    alone = [WeakRows.of(model, {key: x[part] for key, x in run.items()}, design) for part in parts]
    for kind, columns in enumerate(rows.columns):
        both = np.concatenate([one.columns[kind] for one in alone])
        np.testing.assert_allclose(columns, both, rtol=1e-9, atol=1e-9 * np.abs(both).max())
    assert np.count_nonzero(np.diff(rows.numbers) > 1) == 1
    times = np.concatenate(
        [one.end_times() + part.start / design.sample_rate for one, part in zip(alone, parts, strict=True)]
    )
    np.testing.assert_allclose(rows.end_times(), times, atol=1e-9)
    own = sum(len(one.reversals.events) for one in alone)
    assert len(rows.reversals.events) == pytest.approx(own, abs=4)


def test_mechanism_is_identified_from_all_segments() -> None:
    sim = simulation("cart_pendulum")
    run = with_gaps(sim.run(0, SHARP), slice(3_000, 3_300), slice(9_000, 9_050), slice(12_000, 12_900))
    found = identify(sim.model, run, 1000.0, start=sim.truth, design=DESIGNS["cart_pendulum"])
    assert np.all(np.abs(found.p - sim.truth) < 4 * found.se)
    assert found.chi2 < 1.3 and found.verdict.status == "good"
    longest = {key: x[12_900:] for key, x in run.items()}
    alone = identify(sim.model, longest, 1000.0, start=sim.truth, design=DESIGNS["cart_pendulum"])
    assert len(found.times) > 1.5 * len(alone.times)


def test_sample_alone_between_two_gaps_is_no_hindrance() -> None:
    """A derivative of one sample is none; the candidates for what is missing are computed without a warning."""
    sim = simulation("cart_pendulum")
    run = with_gaps(sim.run(0, SHARP), slice(3_000, 3_300), slice(3_301, 3_340), slice(3_342, 3_360))
    found = identify(sim.model, run, 1000.0, start=sim.truth, design=DESIGNS["cart_pendulum"])
    assert np.all(np.abs(found.p - sim.truth) < 4 * found.se) and found.verdict.status == "good"


def test_short_segments_get_a_design_that_fits_them() -> None:
    sim = simulation("cart_pendulum")
    run = sim.run(2)
    n = len(next(iter(run.values())))
    run = with_gaps(run, *(slice(k, k + 40) for k in range(900, n, 1_000)))
    best = ranked(ready(sim.model), run, 1000.0)[0]
    assert best.design.window_s <= 0.96 and best.known


def test_integral_since_the_start_ends_at_a_gap() -> None:
    """Behind it nobody knows the charge that has flowed: the longest segment is used alone."""
    run = simulation("battery_2rc").run(0)
    n = len(next(iter(run.values())))
    gapped = with_gaps(run, slice(n // 3, n // 3 + 20))
    rows = WeakRows.of(ready(compiled_of("battery_2rc")), gapped, DESIGNS["battery_2rc"])
    assert len(rows.record.grid.parts) == 1 and rows.record.grid.places[0] > n // 3


def test_parts_of_a_run_have_windows_of_every_recording() -> None:
    """Halves and folds compare like with like: one recording may not determine what the others do."""
    run: dict[str, npt.ArrayLike] = dict(with_gaps(simulation("cart_pendulum").run(2), slice(5_000, 5_100)))
    design = DESIGNS["cart_pendulum"]
    n = len(np.asarray(run["x"]))
    rows = WeakRows.of(ready(compiled_of("cart_pendulum")), {**run, NUMBER: np.arange(n) >= 5_100}, design)
    own = rows.end_times() * design.sample_rate > 5_100
    np.testing.assert_array_equal(rows.recordings, own)
    for count in (2, 4):
        for part in range(count):
            for recording in (0, 1):
                windows = np.flatnonzero((rows.parts(count) == part) & (rows.recordings == recording))
                whole = np.count_nonzero(rows.recordings == recording)
                assert abs(windows.size - whole / count) < 1 and np.all(np.diff(windows) == 1)
