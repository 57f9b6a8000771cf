"""Wild samples of sensors are interpolated and told; nothing that a mechanism does is taken for one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT

from pvid.base.errors import PvidError
from pvid.cli.identify_run import recording_of
from pvid.identification.analysis import analysed
from pvid.identification.wild_samples import without_wild_samples
from pvid.log.rig_choice import rig_of
from pvid.models.mechanisms import compiled_of, names
from pvid.rig.run import Recording
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, simulation_of

RECORDINGS = ROOT / "tests" / "data" / "recordings"


def recorded(name: str, imperfections: Imperfections = PERFECT) -> Recording:
    simulation = simulation_of(name)
    signals = {key: values[:8000] for key, values in simulation.run(1, imperfections).items()}
    rate = simulation.rig.sample_rate
    return Recording(np.arange(len(next(iter(signals.values())))) / rate, signals, rate)


@pytest.mark.parametrize("imperfections", [PERFECT, SOFT], ids=["sharp", "soft"])
@pytest.mark.parametrize("name", names())
def test_a_mechanism_has_none(name: str, imperfections: Imperfections) -> None:
    recording = recorded(name, imperfections)
    found = without_wild_samples(recording, compiled_of(name))
    assert found.notes == ()
    assert all(found.signals[key] is values for key, values in recording.signals.items())


@pytest.mark.parametrize("name", ["bicycle_fork", "motor_generator", "torso_lift"])
def test_a_real_recording_has_none(name: str) -> None:
    path = RECORDINGS / name / "identify.csv.gz"
    rig = rig_of(path, None, (), str(RECORDINGS / f"{name}.py"))
    recording, _ = recording_of(path, rig, None)
    assert not [note for note in recording.notes if "wild" in note]


def test_wild_samples_of_an_encoder_cost_no_answer() -> None:
    """They spoilt two thirds of the windows, and nothing was identified."""
    recording, model = recorded("dc_motor"), compiled_of("dc_motor")
    phi = recording.signals["phi"].copy()
    places = np.array([700, 1500, 2400, 3300, 4100, 5000, 6100, 7000])
    phi[places] += 3.0
    spoilt = replace(recording, signals={**recording.signals, "phi": phi})
    cleaned = without_wild_samples(spoilt, model)
    assert sum(int(note.split()[0]) for note in cleaned.notes) == 8
    assert "phi" in cleaned.notes[0] and "0.7 s): interpolated" in cleaned.notes[0]
    own = model.signal("phi").sd
    changed = np.flatnonzero(cleaned.signals["phi"] != phi)
    assert set(places) <= set(changed) and np.abs(changed[:, None] - places).min(1).max() <= 2
    assert np.abs(cleaned.signals["phi"] - recording.signals["phi"]).max() < 6 * own
    clean, found = analysed(recording, model), analysed(cleaned, model)
    assert clean.identified and found.identified
    assert (np.abs(found.found.p - clean.found.p) < clean.found.se).all()


def test_a_jump_and_a_burst_are_no_wild_samples() -> None:
    recording, model = recorded("dc_motor"), compiled_of("dc_motor")
    phi = recording.signals["phi"].copy()
    phi[4000:] += 1.0
    phi[6000:6008] += 2.0
    jumped = replace(recording, signals={**recording.signals, "phi": phi})
    assert without_wild_samples(jumped, model).notes == ()


@pytest.mark.parametrize("share", [0.005, 0.04])
@pytest.mark.parametrize("code", [-30.0, 9999.0])
def test_error_codes_of_an_encoder_cost_no_answer(share: float, code: float) -> None:
    recording, model = recorded("cart_pendulum"), compiled_of("cart_pendulum")
    x = recording.signals["x"].copy()
    wild = np.random.default_rng(1).random(len(x)) < share
    x[wild] = code
    cleaned = without_wild_samples(replace(recording, signals={**recording.signals, "x": x}), model)
    assert f"samples of x are far from those about it ({code:g} m in" in cleaned.notes[0]
    assert np.abs(cleaned.signals["x"] - recording.signals["x"]).max() < 0.01
    x[np.random.default_rng(2).random(len(x)) < 0.06] = code
    with pytest.raises(PvidError, match=f"x is far .* most often {code:g} m: an error code of the sensor"):
        without_wild_samples(replace(recording, signals={**recording.signals, "x": x}), model)


@pytest.mark.parametrize(("code", "in_a_row"), [(0.0, 1), (32.767, 1), (0.0, 6)])
def test_error_codes_of_a_current_are_interpolated_though_it_has_corners(code: float, in_a_row: int) -> None:
    """A failed read that is recorded as 0 lies within the motion."""
    recording, model = recorded("dc_motor"), compiled_of("dc_motor")
    i, rng = recording.signals["i"].copy(), np.random.default_rng(8)
    for first in np.cumsum(rng.integers(40 * in_a_row, 160 * in_a_row, 78 // in_a_row)):
        i[first : first + in_a_row] = code
    cleaned = without_wild_samples(replace(recording, signals={**recording.signals, "i": i}), model)
    left = (cleaned.signals["i"] == code) & (np.abs(code - recording.signals["i"]) > 0.3)
    assert np.count_nonzero(left) <= max(5, in_a_row)  # of 78: the steepest motion hides some
    assert np.median(np.abs(cleaned.signals["i"] - recording.signals["i"])[cleaned.signals["i"] != i]) < 0.2
    assert len(cleaned.notes) == 1
    assert cleaned.notes[0].split("samples of i")[1].startswith(f" are far from those about it ({code:g} A in ")


def test_peaks_of_a_current_that_is_faster_than_its_samples_are_no_error_codes() -> None:
    """Some samples behind each step of the voltage; of few levels they have the same height time and again."""
    recording, model = recorded("dc_motor"), compiled_of("dc_motor")
    voltage = np.repeat(np.random.default_rng(4).choice([-6.0, 6.0], len(recording) // 20), 20)
    current, speed = np.zeros(len(voltage)), 0.0
    for k in range(1, len(voltage)):
        current[k] = current[k - 1] + 0.6 * (voltage[k - 1] - speed - current[k - 1])
        speed += 0.37 * current[k]
    signals = {"V": voltage, "i": np.round(current, 1), "phi": recording.signals["phi"][: len(voltage)]}
    assert without_wild_samples(Recording(recording.t[: len(voltage)], signals, 1000.0), model).notes == ()


@pytest.mark.parametrize("code", [-9999.0, 65535.0])
@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc", "rigid_body"])
def test_error_codes_of_any_signal_are_interpolated(name: str, code: float) -> None:
    """Also of what may jump: a measured current that drives, an input; and of samples side by side."""
    recording, model = recorded(name), compiled_of(name)
    random = np.random.default_rng(3)
    for one in model.signals:
        x = recording.signals[one.name].copy()
        places = random.choice(np.arange(1, len(x) - 2), max(4, len(x) // 200), replace=False)
        places = np.unique([*places, places[0] + 1])
        x[places] = code
        cleaned = without_wild_samples(replace(recording, signals={**recording.signals, one.name: x}), model)
        assert np.abs(cleaned.signals[one.name]).max() <= 1.2 * np.abs(recording.signals[one.name]).max(), one.name
        assert [note.split(" of ")[1].split()[0] for note in cleaned.notes] == [one.name]
        assert f"({code:g} {one.unit} in {len(places)} of them" in cleaned.notes[0]
        x[random.random(len(x)) < 0.06] = code
        with pytest.raises(PvidError, match=f"{one.name} is far .* {code:g} {re.escape(one.unit)}: an error code"):
            without_wild_samples(replace(recording, signals={**recording.signals, one.name: x}), model)


def test_single_wild_samples_of_a_measured_current_that_drives_are_interpolated_but_true_pulses_stay() -> None:
    """The voltage moves with a pulse of the cell's current, and not with interference."""
    recording, model = recorded("battery_2rc"), compiled_of("battery_2rc")
    random = np.random.default_rng(5)
    i = recording.signals["i"].copy()
    places = random.choice(np.arange(10, len(i) - 10, 5), 40, replace=False)
    i[places] += random.choice([-1, 1], 40) * random.uniform(3, 20, 40) * np.ptp(i)
    found = without_wild_samples(replace(recording, signals={**recording.signals, "i": i}), model)
    assert np.abs(found.signals["i"]).max() <= np.abs(recording.signals["i"]).max()
    assert len(found.notes) == 1 and found.notes[0].startswith("40 samples of i are far from those about it (")
    pulses = 0.01 * random.standard_normal(len(i))
    pulses[places] = 5.0
    v = np.rint((3.7 - 0.02 * pulses) / 1e-4) * 1e-4 + 1e-4 * random.integers(-1, 2, len(i))
    pulsed = replace(recording, signals={**recording.signals, "i": pulses + 1e-3 * random.random(len(i)), "v": v})
    assert without_wild_samples(pulsed, model).notes == ()


def test_strokes_of_an_input_are_no_error_codes() -> None:
    """A hammer: a force that is 0 but for strokes of many sizes; an input that has two levels."""
    recording, model = recorded("rigid_body"), compiled_of("rigid_body")
    random = np.random.default_rng(4)
    struck = 1e-4 * random.standard_normal(8000)
    struck[500::500] = random.uniform(1, 3, len(struck[500::500]))
    levels = np.where(np.arange(8000) % 400 < 8, 5.0, 0.0)
    signals = {**recording.signals, "m0": struck, "m1": levels}
    found = without_wild_samples(replace(recording, signals=signals), model)
    assert found.signals["m0"] is struck
    assert found.signals["m1"] is levels


def test_a_current_that_follows_short_pulses_of_the_voltage_has_no_error_codes() -> None:
    """Sampled slower than L/R, it falls to exactly 0 with every pulse."""
    recording, model = recorded("dc_motor"), compiled_of("dc_motor")
    pulses = np.where(np.arange(8000) % 40 < 3, 0.0, 6.0)
    quick = {"V": pulses, "i": np.rint(pulses / 1.2 / 0.005) * 0.005}
    pulsed = replace(recording, signals={**recording.signals, **quick})
    assert without_wild_samples(pulsed, model).signals["i"] is pulsed.signals["i"]


def test_noise_of_a_current_beyond_that_of_its_rig_is_no_error_code() -> None:
    """In steps of 1 mA, the same far value comes a few times among 40 000 samples of a noise of 10 mA."""
    current = np.round(np.random.default_rng(1).normal(0, 0.01, 40_000), 3)
    signals = {"V": np.full(40_000, 3.0), "i": current, "phi": np.linspace(0.0, 9.0, 40_000)}
    noisy = Recording(np.arange(40_000) / 1000, signals, 1000.0)
    assert without_wild_samples(noisy, compiled_of("dc_motor")).signals["i"] is current
