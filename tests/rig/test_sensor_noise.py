"""White noise of a sensor that is larger than its rig states; a mechanism that is held before it moves."""

import numpy as np
import pytest

from pvid.identification.reading import without_hold
from pvid.identification.road import identified
from pvid.rig.run import Recording
from pvid.rig.sensor_noise import white_noise, with_noise
from pvid.sim.simulated_run import simulation_of

N = 4000


def recorded(name: str, sensor: str, times: float) -> tuple[Recording, float]:
    """A shipped rig, one sensor of which has so many times the noise of its rig; and that noise."""
    simulation = simulation_of(name)
    run = simulation.run(0)
    sd = times * simulation.model.signal(sensor).sd
    run[sensor] = run[sensor] + sd * np.random.default_rng(7).standard_normal(len(run["t"]))
    return Recording(run.pop("t"), run, simulation.rig.sample_rate), sd


@pytest.mark.parametrize(
    ("name", "sensor"), [("kapitza", "phi"), ("two_mass_drive", "th"), ("free_pendulum", "q"), ("thrust_stand", "F")]
)
def test_noise_is_the_recordings_where_it_is_larger(name: str, sensor: str) -> None:
    model = simulation_of(name).model
    recording, sd = recorded(name, sensor, 10.0)
    noted, found = with_noise(recording, model)
    assert found.signal(sensor).sd == pytest.approx(sd, rel=0.06)
    assert [one for one in noted.notes if one.startswith(f"{sensor} has a white noise of ")] == list(noted.notes)
    assert [one.sd for one in found.signals if one.name != sensor] == [
        one.sd for one in model.signals if one.name != sensor
    ]
    for as_stated in (0.0, 0.5):  # of the noise of the rig
        assert with_noise(recorded(name, sensor, as_stated)[0], model)[1] is model


def test_a_right_answer_of_a_noisy_sensor_is_explained() -> None:
    """A current with 14 times its stated noise made a motor's answer say: the equations lack something, L is biased."""
    simulation = simulation_of("thrust_stand")
    recording, _ = recorded("thrust_stand", "i", 14.0)
    before = identified(recording, simulation.model)
    after = identified(*with_noise(recording, simulation.model))
    assert not before.is_explained and after.is_explained
    assert after.verdict.status == "good"
    for name, truth in simulation.rig.truth.items():
        value = after.values[name]
        assert value.value is not None and value.se is not None
        assert abs(value.value - truth) < 4 * value.se


def test_what_is_not_white_is_no_noise_of_a_sensor() -> None:
    random = np.random.default_rng(3)
    force, smooth = random.standard_normal(N), np.sin(0.02 * np.arange(N))
    walk = np.cumsum(force)
    lag, slow = np.zeros(N), np.zeros(N)
    for k in range(1, N):
        lag[k] = 0.6 * lag[k - 1] + force[k]
        slow[k] = 0.9 * slow[k - 1] + force[k]
    ripple = (-1.0) ** np.arange(N)
    taps = np.convolve(force, [0.25, 0.5, 0.25], "same")
    interpolated = np.interp(np.arange(N), np.arange(0, N, 4), force[::4])
    for motion in (walk, lag, slow, ripple, taps, interpolated, smooth):
        assert white_noise(100 * smooth + motion, []) is None or motion is smooth
    assert white_noise(100 * smooth + force, []) == pytest.approx(1.0, rel=0.06)
    gaps = 100 * smooth + force
    gaps[::37] = np.nan
    assert white_noise(gaps, []) == pytest.approx(1.0, rel=0.08)
    assert white_noise(np.full(N, np.nan), []) is None
    assert white_noise(force[:100], []) is None


def test_what_follows_an_input_is_no_noise_of_a_sensor() -> None:
    random = np.random.default_rng(4)
    drive, noise = random.standard_normal((2, N))
    assert white_noise(5 * drive, []) is not None
    assert white_noise(5 * drive + noise, [drive]) is None
    held = np.repeat(np.sign(drive[: N // 50]), 50)
    assert white_noise(50 * held + noise, [held]) == pytest.approx(1.0, rel=0.25)


@pytest.mark.parametrize("name", ["free_pendulum", "ring_down", "coasting_motor", "coast_down"])
def test_what_holds_a_mechanism_before_it_moves_freely_is_left_out(name: str) -> None:
    simulation = simulation_of(name)
    run = simulation.run(0)
    rate, n = simulation.rig.sample_rate, len(run["t"])
    free = Recording(run.pop("t"), run, rate)
    assert without_hold(free, simulation.model) is free
    held = n // 5
    signals = {one: np.concatenate([np.full(held, x[0]), x]) for one, x in run.items()}
    noted = without_hold(Recording(np.arange(held + n) / rate, signals, rate), simulation.model)
    first = noted.segments[0].start
    assert held <= first < held + n // 20
    assert noted.notes[0].endswith("as if held, and no input moves it: left out")
    assert all(np.isnan(x[:first]).all() for x in noted.signals.values())


def test_rest_with_an_input_is_kept() -> None:
    simulation = simulation_of("dc_motor")
    run = simulation.run(0)
    t = run.pop("t")
    rest = {one: np.concatenate([np.zeros(2000), x]) for one, x in run.items()}
    recording = Recording(np.arange(2000 + len(t)) / simulation.rig.sample_rate, rest, simulation.rig.sample_rate)
    assert without_hold(recording, simulation.model) is recording
