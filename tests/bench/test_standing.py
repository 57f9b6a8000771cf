"""bench standing, short: its columns count what they say; no clean run or accident leaves a wrong valid estimate."""

from dataclasses import replace

import numpy as np
import pytest

from bench import standing
from pvid.codegen.weak_library import weak_native_q31
from pvid.configuration.weak import samples_of
from pvid.configuration.weak_q31 import weak_q31_for_rig_like_the_shipped
from pvid.settings.enums import Doubt, Standing
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


@pytest.mark.parametrize(
    ("core", "reading", "period"),
    [
        *(("f32", 1e3, 1), ("f32", np.nan, 1), ("q31", 1e3, 1)),
        *((core, reading, n) for core, reading in (("f32", np.nan), ("q31", 1e3)) for n in (2, 10, 100, 900, 1700)),
    ],
)
def test_an_estimate_is_valid_until_its_age(core: str, reading: float, period: int) -> None:
    """Where windows are dropped, or samples rejected, all or one in `period`; in 1700 ticks a window is discarded."""
    own = standing.board("kapitza")
    run = own.simulation.run(1)
    first = len(run["phi"]) // 2
    run["phi"][first::period] = reading
    if core == "f32":
        config = replace(own.config, trust=replace(own.config.trust, age_max=8))
        record = replace(own, config=config).record(samples_of(config, run))
        window = config.design.hop * config.design.decimation
    else:
        made = weak_q31_for_rig_like_the_shipped(own.simulation.model)
        fixed = replace(made.config, trust=replace(made.config.trust, age_max=8))
        record = weak_native_q31(made.made, made.parameters, fixed).identifier().run_samples(made.counts_of(run))
        window = fixed.design.hop * fixed.design.decimation
    age, state = record.standing[first:] & 0xFFFF, standing.state_of(record)[first:]
    passed, waits = len(age) / window, period / window  # windows; it grows at a reject or behind a window
    assert state[0] == Standing.VALID and passed - waits - 1 <= age[-1] - age[0] <= passed + 1 and passed > 12
    assert np.array_equal(state == Standing.DOUBTED, age > 8) and record.standing[-1] >> 24 == Doubt.AGED
