"""A short form of the bench of mechanisms: errors near those of the audit, no false warning, rows as on the page."""

import numpy as np
import pytest

from bench import mechanisms

SEEDS = 4

# RMS errors of the audit's weak form [% of the truth].
AUDIT = {
    "dc_motor": {"R": 0.0007, "L": 0.011, "k": 0.0004, "J": 0.0009, "b": 0.051, "Tc": 0.033},
    "cart_pendulum": {"mt": 0.0006, "ml": 0.0012, "J": 0.0024, "b": 0.0039, "Fc": 0.0078, "bp": 0.043},
    "battery_2rc": {"R0": 0.077, "R1": 0.10, "T1": 0.14, "R2": 0.040, "T2": 0.056},
}


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=() if one == "dc_motor" else pytest.mark.night) for one in AUDIT]
)
def test_errors_are_near_those_of_the_audit_and_warnings_are_none(name: str) -> None:
    """The RMS of four runs is above 2.2 times that of many once in 1000 (chi^2 of 4: 18.5 = 4 x 2.15^2)."""
    outcome = mechanisms.smooth(name, SEEDS)
    rms = dict(zip(outcome.simulation.model.p_names, outcome.rms, strict=True))
    for parameter, percent in AUDIT[name].items():
        assert 100 * rms[parameter] / outcome.simulation.rig.truth[parameter] < 2.2 * percent, parameter
    assert outcome.warnings == "-"
    assert outcome.confident_wrong == 0
    assert 0.8 < outcome.chi2 < 1.3
    assert np.all(outcome.close_s <= 2.5 * outcome.simulation.rig.window_s)
    rows = list(mechanisms.accuracy_rows(name, outcome))
    assert [row[1] for row in rows] == list(rms)
    assert all(len(row) == len(mechanisms.ACCURACY) for row in rows)
    assert len(mechanisms.summary_row(name, "soft", outcome)) == len(mechanisms.SUMMARY)


def test_every_imperfection_is_one_that_the_mechanism_can_have() -> None:
    assert mechanisms.number_of_cases("dc_motor") == len(mechanisms.CASES)
    assert mechanisms.number_of_cases("battery_2rc") == len(mechanisms.CASES) - 4  # no friction, no encoder
    rows = list(mechanisms.imperfection_rows("battery_2rc", 1))
    assert [row[1] for row in rows][0] == "none" and all(len(row) == len(mechanisms.IMPERFECT) for row in rows)
    late = next(row for row in rows if row[1] == "one sensor a sample late")
    assert "sensor" in late[6] and late[7] == "0/1"


def test_what_two_windows_can_say_is_shown_where_they_do_not_suffice(monkeypatch: pytest.MonkeyPatch) -> None:
    outcome = mechanisms.smooth("dc_motor", 2)
    assert not list(mechanisms.two_window_rows("dc_motor", "soft", outcome))
    monkeypatch.setattr(mechanisms, "CLOSE", 0.0)
    rows = list(mechanisms.two_window_rows("dc_motor", "soft", outcome))
    assert [row[2] for row in rows] == list(outcome.simulation.model.p_names)
    assert all(len(row) == len(mechanisms.TWO_WINDOWS) and row[3] == "2/2" for row in rows)
    # The rows of two windows that overlap by half do not use all that their samples say.
    assert all(float(row[5]) > 0.5 * float(row[6]) > 0 for row in rows)
