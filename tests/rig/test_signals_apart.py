"""Each signal comes to the common clock by itself: blank cells, inputs logged on change, sensors of other rates."""

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import Recording, recording_of_arrays

Float = npt.NDArray[np.float64]

RATE = 500.0
LSB = 1e-5
COLUMNS = Columns((Channel("F", "N", held=True), Channel("x", "m")))


def motion(t: Float) -> Float:
    return 0.02 * np.sin(6.0 * t) + 0.01 * np.sin(17.0 * t + 1.0)


def sampled(t: Float, seed: int = 1) -> Float:
    noise = 0.5 * LSB * np.random.default_rng(seed).standard_normal(t.size)
    return np.rint((motion(t) + noise) / LSB) * LSB


def steps(t: Float, seed: int = 2) -> Float:
    """A new force every 0.1 s, as a program sets it."""
    levels = np.random.default_rng(seed).uniform(-5, 5, 1000).round(2)
    return np.asarray(levels[(t / 0.1 + 1e-9).astype(int)])


def clock(seconds: float = 10.0) -> Float:
    return np.arange(round(seconds * RATE)) / RATE


def read(t: Float, force: Float, x: Float, rate: float | None = None) -> Recording:
    return recording_of_arrays({"t": t, "F": force, "x": x}, rate, COLUMNS)


def blank(values: Float, where: npt.ArrayLike) -> Float:
    out = values.copy()
    out[np.asarray(where)] = np.nan
    return out


def test_blank_cell_of_a_sensor_leaves_a_stepping_input_as_it_is() -> None:
    t = clock()
    force, x = steps(t), sampled(t)
    missing = np.flatnonzero(np.random.default_rng(3).random(t.size) < 0.15)[1:-1]
    found = read(t, force, blank(x, missing))
    there = np.isfinite(found.signals["x"])
    assert there.mean() > 0.995  # chance makes the samples beside a gap rough now and then
    assert (found.signals["F"] == force)[there].all()
    assert np.abs(found.signals["x"] - motion(t))[there].max() < 10 * LSB
    assert found.notes[0].startswith("missing samples of x: ")


def test_arrays_of_the_caller_stay_as_they_are() -> None:
    t = clock()
    x = blank(sampled(t), [700, 701])
    given = x.copy()
    read(t, steps(t), x)
    assert x.tobytes() == given.tobytes()


def test_blank_cell_of_a_held_input_keeps_its_value() -> None:
    t = clock()
    force = steps(t)
    logged = blank(force, 1 + np.flatnonzero(np.diff(force) == 0))
    found = read(t, logged, sampled(t))
    assert found.signals["F"].tobytes() == force.tobytes()
    assert found.notes == (f"F is blank where it does not change: {np.isnan(logged).sum()} cells keep its value",)


def test_input_that_is_set_once_is_a_constant() -> None:
    t = clock()
    found = read(t, blank(np.full(t.size, 2.5), np.arange(1, t.size)), sampled(t))
    assert (found.signals["F"] == 2.5).all()


def test_sensor_with_two_numbers_is_refused_by_its_name() -> None:
    t = clock()
    with pytest.raises(PvidError, match="column x: it has 2 numbers; a run needs at least 5"):
        read(t, steps(t), blank(sampled(t), np.arange(2, t.size)))


def test_lost_rows_at_a_step_of_a_held_input_take_the_mean_of_all_instants() -> None:
    t = clock()
    force, x = steps(t), sampled(t)
    gone = [1000, 1525]  # at a step, and between two
    kept = np.delete(np.arange(t.size), gone)
    found = read(t[kept], force[kept], x[kept])
    assert found.signals["F"][1000] == pytest.approx((force[999] + force[1001]) / 2)
    assert found.signals["F"][1525] == force[1525]
    assert np.isfinite(found.signals["x"]).all()


def test_long_gap_of_a_stepping_input_is_not_guessed() -> None:
    t = clock()
    force = blank(steps(t), np.arange(1010, 1390))
    found = read(t, force, sampled(t))
    assert np.isnan(found.signals["F"][1010:1390]).all() and np.isnan(found.signals["x"][1010:1390]).all()
    assert np.isfinite(found.signals["x"][1390:]).all()
    assert any("missing samples of F: 380 of 5000" in note for note in found.notes)


@pytest.mark.parametrize("every", [2, 3, 10])
def test_slow_sensor_is_interpolated_within_its_noise(every: int) -> None:
    t = clock()
    force, x = steps(t), sampled(t)
    found = read(t, force, blank(x, np.flatnonzero(np.arange(t.size) % every != 1)))
    own = found.signals["x"]
    assert own.size == pytest.approx(t.size, abs=every) and np.isfinite(own).all()
    assert found.signals["F"].tobytes() == force[1 : 1 + own.size].tobytes()
    assert np.sqrt(np.mean((own - motion(found.t)) ** 2)) < 0.6 * LSB  # a sample's own error: 0.58
    assert found.ticks_between == {"x": every}
    assert f"x has a sample every {every} ticks: interpolated at 500 Hz by splines" in found.notes


@pytest.mark.parametrize("logged_on_change", [True, False])
def test_signals_with_stamps_of_their_own_are_read_at_those_of_the_fastest(logged_on_change: bool) -> None:
    of_x = clock() + 0.0004
    of_force = np.arange(0.0, 10.0, 0.1 if logged_on_change else 0.00731)
    t = np.concatenate([of_x, of_force])
    order = np.argsort(t, kind="stable")
    x = np.concatenate([sampled(of_x), np.full(of_force.size, np.nan)])[order]
    force = np.concatenate([np.full(of_x.size, np.nan), steps(of_force)])[order]
    found = read(t[order], force, x)
    assert found.sample_rate == 500.0
    np.testing.assert_allclose(found.signals["x"], sampled(of_x)[: len(found)], atol=1e-12)
    held = steps(of_force)[np.searchsorted(of_force, found.t, side="right") - 1]
    exact = found.signals["F"] == held
    assert exact.mean() > (0.97 if logged_on_change else 0.9)
    # a step between two ticks: the mean of the force over the tick, so that its impulse is right
    assert abs(np.sum(found.signals["F"]) / RATE - np.sum(held[:-1]) / RATE) < 0.05
    assert any("stamps of their own" in note for note in found.notes)


def test_rows_of_one_stamp_are_one_row() -> None:
    t = clock()
    force, x, none = steps(t), sampled(t), np.full(t.size, np.nan)
    twice = np.repeat(t, 2)
    found = read(twice, np.stack([force, none], 1).ravel(), np.stack([none, x], 1).ravel())
    assert found.signals["F"].tobytes() == force.tobytes() and found.signals["x"].tobytes() == x.tobytes()
    assert found.sample_rate == 500.0


def test_jittering_stamps_give_a_held_input_its_mean_over_each_tick() -> None:
    t = clock() + 3e-4 * np.random.default_rng(4).uniform(-1, 1, 5000)
    force = steps(np.abs(t))
    found = read(t, force, sampled(t))
    levels = np.unique(steps(clock()))
    assert found.signals["F"].min() >= levels[0] and found.signals["F"].max() <= levels[-1]  # no polynomial overshoots
    assert np.isin(found.signals["F"], levels).mean() > 0.97
