"""Several recordings as one: segments behind each other, each with its name."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.rig.columns import Channel, Columns
from pvid.rig.run import NUMBER, Recording, recording_of_arrays
from pvid.rig.together import joined, names_of

Float = npt.NDArray[np.float64]

COLUMNS = Columns((Channel("F", "N", held=True), Channel("x", "m")))


def motion(t: Float) -> Float:
    return 0.02 * np.sin(6.0 * t) + 0.01 * np.sin(17.0 * t)


def recording(seconds: float, rate: float = 500.0, begin: float = 0.0) -> Recording:
    t = begin + np.arange(round(seconds * rate)) / rate
    return recording_of_arrays({"t": t, "F": np.floor(4 * t), "x": motion(t)}, None, COLUMNS)


def test_samples_keep_their_bits_and_times_follow_each_other() -> None:
    first, second = recording(2.0), recording(3.0, begin=100.0)
    found = joined([first, second], ("a", "b"), COLUMNS)
    assert [one.name for one in found.origins] == ["a", "b"] and len(found.segments) == 2
    for one, part in zip(found.origins, (first, second), strict=True):
        for name, x in part.signals.items():
            np.testing.assert_array_equal(found.signals[name][one.first : one.end], x)
        assert np.all(found.run[NUMBER][one.first : one.end] == found.origins.index(one))
    np.testing.assert_allclose(np.diff(found.t), 1 / 500.0, rtol=1e-6)
    assert found.t[0] == first.t[0] and found.sample_rate == 500.0
    assert "a from 0 s and b from" in found.notes[-1]


def test_a_single_recording_stays_as_it_is() -> None:
    one = recording(2.0)
    assert joined([one], ("a",), COLUMNS) is one
    assert one.run is one.signals


def test_notes_of_each_recording_name_it() -> None:
    t = np.arange(1000) / 500.0
    x = motion(t)
    x[400:402] = np.nan
    bridged = recording_of_arrays({"t": t, "F": np.floor(4 * t), "x": x}, None, COLUMNS)
    found = joined([recording(2.0), bridged], ("a", "b"), COLUMNS)
    assert [note for note in found.notes if note.startswith("b: missing samples")]


def test_a_clock_that_is_off_is_interpolated_at_the_first_ones_times() -> None:
    """1 % of a quartz or an RC oscillator; cubics through 50 samples a period are right to 1e-5 of the motion."""
    found = joined([recording(2.0), recording(2.0, 505.0)], ("a", "b"), COLUMNS)
    own = found.origins[1]
    x = found.signals["x"][own.first : own.end]
    assert np.abs(x - motion(np.arange(x.size) / 500.0)).max() < 1e-6
    assert set(found.signals["F"][own.first : own.end]) >= {0.0, 1.0, 2.0}  # held: means about its changes
    assert [note for note in found.notes if note.startswith("b: its clock is +1 % off that of a")]


def test_a_gap_in_a_recording_with_another_clock_stays_a_gap() -> None:
    t = np.arange(2020) / 505.0
    kept = (t < 1.5) | (t > 2.0)
    gapped = recording_of_arrays({"t": t[kept], "F": np.floor(4 * t)[kept], "x": motion(t)[kept]}, None, COLUMNS)
    assert len(joined([recording(2.0), gapped], ("a", "b"), COLUMNS).segments) == 3


def test_another_sample_rate_is_refused_with_what_to_do() -> None:
    with pytest.raises(PvidError, match="b is sampled at 1000 Hz and a at 500 Hz.*resample one of them"):
        joined([recording(2.0), recording(2.0, 1000.0)], ("a", "b"), COLUMNS)


def test_the_longest_stretch_of_several_recordings_is_named() -> None:
    whole = joined([recording(2.0), recording(3.0)], ("a", "b"), COLUMNS).whole()
    assert whole.notes[-1].endswith("of b") and not whole.origins and len(whole) == 1500


def test_names_are_stems_and_differ(tmp_path: Path) -> None:
    assert names_of([Path("on.csv"), Path("off.csv.gz")]) == ("on", "off")
    assert names_of([Path("/m/1/run.csv"), Path("/m/2/run.csv")]) == ("1/run", "2/run")
    assert len(set(names_of([Path("/1/m/run.csv"), Path("/2/m/run.csv")]))) == 2
    with pytest.raises(PvidError, match="given twice"):
        names_of([tmp_path / "run.csv", tmp_path / "x" / ".." / "run.csv"])
