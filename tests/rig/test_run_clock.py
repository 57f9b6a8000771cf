"""Clocks that are not uniform and samples that are missing: bridged where the run allows it, and always told."""

import math
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pendulum_run import Run, read_run

from pvid.base.errors import PvidError
from pvid.rig.gaps import bridge

Float = npt.NDArray[np.float64]

RATE = 1000.0
LSB = 2 * np.pi / 2**14  # of the encoder; its noise is half of it

relaxed = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def phi_at(t: Float) -> Float:
    """Both modes of the standard rig: up to 1.9 rad/s, 22 rad/s^2."""
    return 0.1 * np.sin(5.0 * t) + 0.1 * np.sin(14.0 * t + 1.0)


def y_at(t: Float) -> Float:
    return 0.01 * np.sin(13.0 * t) + 0.01 * np.sin(7.0 * t)


def measured(t: Float, seed: int = 1) -> tuple[Float, Float]:
    """What the sensors give at the times t."""
    random = np.random.default_rng(seed)
    phi = np.rint((phi_at(t) + 0.5 * LSB * random.standard_normal(t.size)) / LSB) * LSB
    return phi, np.round(y_at(t) + 5e-6 * random.standard_normal(t.size), 6)


def read(folder: Path, t: Float, phi: Float, y: Float, rate: float | None = None, digits: str = "") -> Run:
    """The run in a file of these columns."""
    rows = zip(t.tolist(), phi.tolist(), y.tolist(), strict=True)
    path = folder / "run.csv"
    path.write_text("t,phi,y\n" + "".join(f"{a:{digits}},{b!r},{c!r}\n" for a, b, c in rows))
    return read_run(path, rate)


def uniform(seconds: float = 10.0, rate: float = RATE) -> Float:
    return np.arange(int(seconds * rate)) / rate


def rms(values: Float) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


# ---- nothing is done to what needs nothing


@pytest.mark.parametrize("start", [0.0, -3.0, 1.7e9])
@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0, 5000.0, 1024.0])
def test_a_uniform_run_keeps_every_bit(start: float, rate: float, tmp_path: Path) -> None:
    t = start + uniform(4.0, rate)
    phi, y = measured(t)
    run = read(tmp_path, t, phi, y)
    for one, other in ((run.t, t), (run.phi, phi), (run.y, y)):
        assert one.tobytes() == other.tobytes()
    assert run.notes == () and run.sample_rate == rate


def test_stamps_of_few_decimals_are_accepted(tmp_path: Path) -> None:
    t = uniform()
    phi, y = measured(t)
    run = read(tmp_path, np.round(t + 3e-5, 4), phi, y)
    assert run.notes == () and run.phi.tobytes() == phi.tobytes()


# ---- rounded stamps


@pytest.mark.parametrize(
    ("rate", "digits"), [(1024.0, ".3f"), (700.0, ".3f"), (400.0, ".3f"), (1000.0, ".2f"), (3000.0, ".3f")]
)
def test_rounded_stamps_leave_the_samples_as_they_are(rate: float, digits: str, tmp_path: Path) -> None:
    t = uniform(20.0, rate)
    phi, y = measured(t)
    run = read(tmp_path, t, phi, y, digits=digits)
    assert run.phi.tobytes() == phi.tobytes() and run.y.tobytes() == y.tobytes()
    assert run.sample_rate == pytest.approx(rate, rel=1e-6)  # rounding of 1 ms at random over 20 s and 8000 rows
    assert len(run.notes) == 1 and run.notes[0].startswith("t is rounded to 0.0")
    assert read(tmp_path, t, phi, y, rate, digits).sample_rate == rate


def test_six_digits_round_a_long_run_ever_more(tmp_path: Path) -> None:
    t = uniform(300.0, 500.0)
    phi, y = measured(t)
    run = read(tmp_path, t, phi, y, digits=".6g")
    assert run.phi.tobytes() == phi.tobytes() and run.sample_rate == 500.0


def test_a_sample_missing_among_rounded_stamps_is_seen(tmp_path: Path) -> None:
    t = np.delete(uniform(20.0, 700.0), [5000, 9000])
    run = read(tmp_path, t, *measured(t), digits=".3f")
    assert len(run) == 14_000 and run.sample_rate == pytest.approx(700.0, rel=1e-6)
    assert "missing samples: 2 of 14000, in 2 gaps" in run.notes[-1]


# ---- missing samples


def test_dropped_sample_is_interpolated_and_reported(tmp_path: Path) -> None:
    t = uniform()
    phi, y = measured(t)
    gone = [1234]
    run = read(tmp_path, np.delete(t, gone), np.delete(phi, gone), np.delete(y, gone))
    kept = np.delete(np.arange(t.size), gone)
    assert run.phi[kept].tobytes() == phi[kept].tobytes() and run.y[kept].tobytes() == y[kept].tobytes()
    np.testing.assert_allclose(run.t, t, atol=1e-12)
    assert run.notes == ("missing samples: 1 of 10000, in 1 gap (first at 1.234 s, longest 0.001 s), interpolated",)
    # 5 standard deviations of the fit's own noise, which is a third of a sample's
    assert abs(run.phi[1234] - phi_at(t)[1234]) < 5 / 3 * 0.6 * LSB


def test_empty_and_nan_cells_are_missing_samples(tmp_path: Path) -> None:
    t = uniform(2.0)
    phi, y = measured(t)
    rows = [f"{a!r},{b!r},{c!r}" for a, b, c in zip(t.tolist(), phi.tolist(), y.tolist(), strict=True)]
    rows[0], rows[700] = "0.0,,", f"0.7,,{float(y[700])!r}"
    rows[900], rows[901] = f"0.9,nan,{float(y[900])!r}", f"0.901,{float(phi[901])!r},NA"
    (tmp_path / "run.csv").write_text("t,phi,y\n" + "\n".join(rows) + "\n")
    run = read_run(tmp_path / "run.csv")
    assert len(run) == 1999 and np.isfinite(run.phi).all() and np.isfinite(run.y).all()
    assert run.phi[0] == phi[1] and run.t[0] == t[1]
    assert run.notes[0] == "cells without a number, taken as missing: 1 of y ('NA')"
    assert run.notes[1] == "rows without numbers at the ends, left out: 1"
    assert run.notes[2].startswith("missing samples of phi: 2 of 1999, in 2 gaps")
    assert run.notes[3].startswith("missing samples of y: 1 of 1999, in 1 gap")
    assert (run.y[[699, 899]] == y[[700, 900]]).all() and run.phi[900] == phi[901]  # what stands beside stays


def test_long_gaps_stay_empty(tmp_path: Path) -> None:
    t = uniform()
    kept = np.ones(t.size, bool)
    kept[2000:2005] = kept[4000:4300] = False
    phi, y = measured(t)
    run = read(tmp_path, t[kept], phi[kept], y[kept])
    assert len(run) == t.size
    missing = np.isnan(run.phi)
    np.testing.assert_array_equal(np.flatnonzero(missing), np.arange(4000, 4300))
    np.testing.assert_array_equal(np.isnan(run.y), missing)
    assert "missing samples: 5 of 10000, in 1 gap (first at 2 s, longest 0.005 s), interpolated" in run.notes
    assert any("missing samples: 300 of 10000" in note and "starts its windows again" in note for note in run.notes)
    whole = Run.of(run.recording.whole())
    assert len(whole) == 5700 and whole.t[0] == pytest.approx(4.3) and np.isfinite(whole.phi).all()
    assert whole.notes[-1] == "used is the longest stretch without a gap: 4.3 s to 9.999 s"


@pytest.mark.parametrize("rate", [200.0, 1000.0, 5000.0])
@pytest.mark.parametrize("milliseconds", [5.0, 10.0, 20.0])
def test_interpolated_value_is_as_accurate_as_a_sample(rate: float, milliseconds: float) -> None:
    t = uniform(20.0, rate)
    length = round(milliseconds * 1e-3 * rate)
    phi, y = measured(t)
    firsts = np.arange(int(0.5 * rate), t.size - 100, int(0.3 * rate))
    gaps = (firsts[:, None] + np.arange(length)).ravel()
    phi[gaps] = y[gaps] = np.nan
    bridge(phi, rate)
    bridge(y, rate)
    filled = np.isfinite(phi[gaps])
    assert filled.mean() > 0.95  # the others lie where chance makes the samples beside them rough
    # a sample's own error: half an LSB of noise and its rounding
    assert rms((phi - phi_at(t))[gaps]) < 1.3 * np.hypot(0.5, 1 / np.sqrt(12)) * LSB
    assert rms((y - y_at(t))[gaps]) < 1.5 * 5e-6


def test_a_gap_is_not_interpolated_where_the_motion_is_too_fast_for_it() -> None:
    t = uniform(2.0)
    phi = 0.1 * np.sin(150.0 * t)  # 24 Hz: 20 ms are half a period
    phi[1000:1020] = np.nan
    bridge(phi, RATE)
    assert np.isnan(phi[1000:1020]).all()


@pytest.mark.filterwarnings("error")
def test_a_gap_is_interpolated_in_any_unit() -> None:
    t = uniform(2.0)
    phi, y = measured(t)
    phi[1000:1005] = np.nan
    large = [math.ldexp(1.0, 600) * phi, math.ldexp(1.0, -600) * y]  # their squares are beyond float64
    for signal in (phi, y, *large):
        bridge(signal, RATE)
    assert np.isfinite(phi).all()
    assert large[0].tobytes() == (math.ldexp(1.0, 600) * phi).tobytes()
    assert large[1].tobytes() == (math.ldexp(1.0, -600) * y).tobytes()


def test_a_row_that_was_written_twice_is_left_out(tmp_path: Path) -> None:
    t = uniform()
    phi, y = measured(t)
    twice = np.sort(np.append(np.arange(t.size), [77, 5000]))
    run = read(tmp_path, t[twice], phi[twice], y[twice])
    assert run.phi.tobytes() == phi.tobytes() and run.sample_rate == 1000.0
    assert run.notes == ("rows that repeat the one before them, left out: 2 (first: line 80)",)


# ---- jitter


def test_samples_taken_at_irregular_times_are_interpolated(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    t = uniform() + 2e-4 * random.uniform(-1, 1, 10_000)
    phi, y = measured(t)
    run = read(tmp_path, t, phi, y)
    assert run.sample_rate == 1000.0
    assert np.abs(np.diff(run.t) - 1e-3).max() < 1e-12
    # as good as the samples: cubics of noisy samples at nearly their own times neither add nor remove noise
    assert rms(run.phi - phi_at(run.t)) < 1.05 * rms(phi - phi_at(t))
    assert rms(run.y - y_at(run.t)) < 1.05 * rms(y - y_at(t))
    # taken as uniform, the same samples would be off by the motion within the jitter
    assert rms(y - y_at(uniform())) > 2 * rms(run.y - y_at(run.t))
    assert len(run.notes) == 1
    assert re.fullmatch(
        r"t jitters by up to 0\.2 periods \(0\.0002 s, line \d+\): phi and y are interpolated at 1000 Hz from the "
        r"recorded times",
        run.notes[0],
    )


def test_uniform_samples_that_were_stamped_late_are_left_as_they_are(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    t = uniform()
    phi, y = measured(t)
    run = read(tmp_path, t + 4e-4 * random.uniform(0, 1, t.size), phi, y)
    assert run.phi.tobytes() == phi.tobytes() and run.y.tobytes() == y.tobytes()
    assert run.sample_rate == pytest.approx(1000.0, rel=1e-6)
    assert len(run.notes) == 1 and "phi and y are smoother without that" in run.notes[0]


def test_a_loop_that_takes_longer_now_and_then_is_interpolated(tmp_path: Path) -> None:
    """Arduino's delay(2) and some work: periods of 2.0 to 2.3 ms that keep no grid at all."""
    random = np.random.default_rng(5)
    t = np.cumsum(2e-3 + 3e-4 * random.random(5000))
    phi, y = measured(t)
    run = read(tmp_path, np.round(t, 6), phi, y)
    assert run.sample_rate == pytest.approx(465.0, rel=3e-3)  # 1 / 2.15 ms, by chance and rounded to 0.1 %
    assert rms(run.phi - phi_at(run.t)) < 1.05 * rms(phi - phi_at(t))
    assert not any("missing" in note for note in run.notes)
    # to the rig file's rate, where there is one
    assert read(tmp_path, np.round(t, 6), phi, y, 480.0).sample_rate == 480.0


def test_samples_missing_from_a_jittering_run_are_seen(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    t = uniform() + 2e-4 * random.uniform(-1, 1, 10_000)
    kept = np.ones(t.size, bool)
    kept[[500, 3000, 3001, 7000]] = False
    kept[8000:8200] = False
    run = read(tmp_path, t[kept], *measured(t[kept]))
    assert len(run) == pytest.approx(10_000, abs=1)
    assert "steps longer than 1.5 periods, of late samples or missing ones: 4" in run.notes[0]
    assert re.match(r"missing samples: 2 of \d+, in 1 gap .* interpolated", run.notes[1])
    missing = np.flatnonzero(np.isnan(run.phi))
    assert missing.size == pytest.approx(200, abs=1) and abs(missing[0] - 8000) <= 1
    assert rms(run.phi - phi_at(run.t)) < 1.05 * rms(measured(t)[0] - phi_at(t))


def test_stamps_in_bursts_are_those_of_the_serial_port(tmp_path: Path) -> None:
    """A PC stamps what it gets every 16 ms; the board had sampled uniformly."""
    t = uniform()
    phi, y = measured(t)
    stamps = np.ceil((t + 1e-9) / 0.016) * 0.016
    run = read(tmp_path, stamps, phi, y)
    assert run.phi.tobytes() == phi.tobytes()
    assert run.sample_rate == pytest.approx(1000.0, rel=1e-5)  # 16 ms over 10 s, averaged over 625 bursts
    assert "t arrives in bursts" in run.notes[0] and "a missing one would not be seen" in run.notes[0]
    apart = stamps + 1e-5 * (np.arange(t.size) % 16)  # read one after the other
    again = read(tmp_path, apart, phi, y)
    assert again.phi.tobytes() == phi.tobytes() and "smoother without that" in again.notes[0]


def test_a_clock_that_changes_its_rate_is_interpolated(tmp_path: Path) -> None:
    t = np.concatenate([np.arange(2000) / 1000.0, 2.0 + np.arange(2000) / 960.0])
    run = read(tmp_path, t, *measured(t), 1000.0)
    assert run.sample_rate == 1000.0
    assert rms(run.phi - phi_at(run.t)) < 0.7 * LSB
    assert len(run.notes) == 1 and "t jitters" in run.notes[0]


# ---- the rig file's rate


def test_clock_of_the_run_overrides_the_rig_file_with_a_note(tmp_path: Path) -> None:
    t = uniform(10.0, 1001.0)
    phi, y = measured(t)
    run = read(tmp_path, t, phi, y, 1000.0)
    assert run.sample_rate == pytest.approx(1001.0, rel=1e-6)
    assert run.phi.tobytes() == phi.tobytes()
    assert run.notes == ("t runs at 1001 Hz, +0.1 % off the rig's sample rate: t is used",)
    assert read(tmp_path, uniform(10.0, 1000.05), phi[:10000], y[:10000], 1000.0).notes == ()


def test_rows_from_the_last_to_the_first_are_turned(tmp_path: Path) -> None:
    t = uniform(2.0, 500.0)
    phi, y = measured(t)
    run = read(tmp_path, t[::-1], phi[::-1], y[::-1], 500.0)
    np.testing.assert_array_equal(run.phi, phi)
    assert run.notes == ("the last row comes first: turned",)


def test_a_clock_of_another_rate_is_refused_with_its_likely_cause(tmp_path: Path) -> None:
    t = uniform(2.0, 500.0)
    phi, y = measured(t)
    with pytest.raises(PvidError, match="500 Hz, but the rig's .* 1000 Hz: if t is right, use --set sample_rate=500"):
        read(tmp_path, t, phi, y, 1000.0)
    with pytest.raises(PvidError, match="t looks like us: use --columns t=t:us"):
        read(tmp_path, t * 1e6, phi, y, 500.0)


# ---- what is hopeless


STRETCHED = uniform(1.0) + 5e-5 * np.sin(np.arange(1000))  # a twentieth of a period: not rounded, and no jitter


@pytest.mark.parametrize(
    ("times", "part"),
    [
        (
            np.random.default_rng(4).uniform(0.0, 1.0, 1000),
            r"column t: 0.\d+ s runs back from the time before it, 0.\d+ s, as at \d+ more rows",
        ),
        (np.zeros(100), "line 3, column t: 0.0 s repeats the time before it, as all times do"),
        (np.sort(np.append(STRETCHED, STRETCHED[500])), "line 503, column t: 0.49.* s repeats the time before it"),
        (np.array([0.0, 1.0, 2.0, 1e308, 1.1e308]), "too far from the first time"),
        (np.array([-1e308, 0.0, 1.0, 2.0, 1e308]), "too far from the first time"),
    ],
    ids=["in no order", "no time at all", "a repeated row", "huge", "huge both ways"],
)
def test_unexplainable_clock_is_refused(times: Float, part: str, tmp_path: Path) -> None:
    phi = np.random.default_rng(1).standard_normal(times.size)
    with pytest.raises(PvidError, match=part) as caught:
        read(tmp_path, times, phi, phi)
    assert "\n" not in str(caught.value)


@given(
    steps=st.lists(st.one_of(st.floats(0.0, 3.0), st.integers(1, 6).map(float)), min_size=6, max_size=80),
    scale=st.sampled_from([1e-6, 1e-3, 1.0, 1e5]),
    digits=st.sampled_from(["", ".3f", ".6g"]),
    rate=st.sampled_from([None, 1000.0]),
)
# No tick of a uniform clock is near a sample.
@example(steps=[0.0, 1.0, 1.0, 3.0, 0.25, 0.25], scale=1.0, digits="", rate=None)
@relaxed
def test_any_times_that_do_not_run_back_give_a_run_or_a_sentence(
    steps: list[float], scale: float, digits: str, rate: float | None, tmp_path: Path
) -> None:
    t = scale * np.cumsum(steps)
    try:
        run = read(tmp_path, t, *measured(t), rate, digits)
    except PvidError as error:
        assert "\n" not in str(error)
        return
    assert np.isfinite(run.t).all() and (np.diff(run.t) > 0).all()
    assert len(run) < 4 * t.size + 10  # no more than what is missing doubles it
    assert np.isfinite(run.phi).any() and np.isfinite([run.phi[0], run.phi[-1]]).all()
    assert run.notes or len(run) == t.size
