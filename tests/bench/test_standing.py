"""bench standing, short: its columns count what they say; no clean run or accident leaves a wrong valid estimate."""

import numpy as np
import pytest

from bench import standing
from pvid.settings.record import Record


def test_a_wrong_value_is_beyond_five_errors_and_a_thousandth() -> None:
    values = np.array([[1.0, 2.0], [1.06, 2.0], [1.0005, 2.0]], np.float32)
    errors = np.array([[0.01, 0.1], [0.01, 0.1], [0.00001, 0.1]], np.float32)
    record = Record(values, values, np.zeros(3, np.uint8), published=values, published_se=errors)
    z, wrong = standing.errors_of(record, np.array([1.0, 2.0]), [0, 1])
    np.testing.assert_allclose(z, [0, 6, 50], rtol=0.01)
    assert wrong.tolist() == [False, True, False]


def test_a_late_drive_or_a_wrong_gain_is_within_the_errors_and_dead_time_is_not_valid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    late, gain = "PWM late by 0.1 tick", "gain of the current 1 % too large"
    few = {name: standing.IMPERFECTIONS[name] for name in ("none", "dead time 0.1 V", late, gain)}
    monkeypatch.setattr(standing, "IMPERFECTIONS", few)
    rows = {row[0]: row for row in standing.imperfect_rows(2, 8.0, lambda: None)}
    for name, worst in (("none", 0.5), (late, 1.5), (gain, 1.5)):  # of standard deviations that are stated
        _, results, wrong, valid, both, largest = rows[name]
        assert int(valid) > 0.6 * int(results) > 10 and int(wrong) == int(both) == 0 and float(largest) < worst
    _, results, _, valid, _, _ = rows["dead time 0.1 V"]
    assert int(results) > 10 and int(valid) == 0


def test_an_unplugged_sensor_leaves_nothing_wrong_and_valid() -> None:
    name, runs, wrong, mute, meanwhile = standing.accident_row("dc_motor", 2, 4.0)
    assert (name, runs, wrong, mute, meanwhile) == ("dc_motor", "2", "0", "0", "0")


def test_a_clean_run_is_valid_at_its_end_and_never_withdrawn() -> None:
    _, published, doubted, _, withdrawn, valid = standing.clean_row("dc_motor", 1, 15.0)
    assert int(published) > 20 and int(doubted) < 0.1 * int(published) and (withdrawn, valid) == ("0", "1 of 1")
