"""The step of a sensor, found in what it recorded."""

from __future__ import annotations

import numpy as np
import pytest

from pvid.rig.file import RigFile, Unset
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolution_note, resolution_of, resolved

T = np.arange(0.0, 15.0, 1 / 500)
SWING = np.sin(5 * T) + 0.3 * np.sin(17 * T + 1)


def recorded(step: float, size: float, noise: float = 0.5) -> np.ndarray:
    """A swing as an encoder reads it, its grid anywhere."""
    random = np.random.default_rng(1)
    return np.asarray(step * np.round(size * SWING / step + noise * random.standard_normal(T.size) + 0.3) + 0.1)


@pytest.mark.parametrize("bits", [10, 12, 14, 16, 18])
@pytest.mark.parametrize("size", [0.02, 0.1, 0.5])
def test_the_step_is_found(bits: int, size: float) -> None:
    step = 2 * np.pi / 2**bits
    assert resolution_of(recorded(step, size)) == pytest.approx(step, rel=1e-6)
    assert resolution_of(recorded(step, size, noise=0.0)) == pytest.approx(step, rel=1e-6)


def test_the_step_is_found_behind_decimals_of_text() -> None:
    step = 2 * np.pi / 2**14
    for decimals in (4, 5, 6):  # at 4 the decimals are a quarter of a step
        assert resolution_of(np.round(recorded(step, 0.1), decimals)) == pytest.approx(step, rel=1e-3)
    assert resolution_of(np.round(recorded(step, 0.1), 3)) == pytest.approx(1e-3)  # nothing finer is in the file


def test_the_step_is_found_in_degrees_and_in_float32() -> None:
    step = 2 * np.pi / 2**12
    assert resolution_of(np.degrees(recorded(step, 0.1))) == pytest.approx(360 / 2**12, rel=1e-6)
    assert resolution_of(recorded(step, 0.1).astype(np.float32)) == pytest.approx(step, rel=1e-5)


def test_values_that_lie_anywhere_have_no_step() -> None:
    random = np.random.default_rng(2)
    for n in (300, 7500):
        for _ in range(5):
            assert resolution_of(random.standard_normal(n)) is None
    assert resolution_of(0.1 * SWING) is None
    assert resolution_of((0.1 * SWING).astype(np.float32)) is None


def test_too_few_values_have_no_step() -> None:
    for values in ([], [0.1], [0.0] * 100, [0.0, 0.1, 0.2] * 30, [np.nan, np.inf] * 10):
        assert resolution_of(values) is None


def test_values_that_are_not_numbers_are_left_out() -> None:
    values = recorded(0.01, 0.5)
    values[::7] = np.nan
    values[::11] = np.inf
    assert resolution_of(values) == pytest.approx(0.01, rel=1e-6)


def test_interpolated_samples_do_not_show_another_step() -> None:
    step = 2 * np.pi / 2**12
    values = recorded(step, 0.1)
    filled = np.random.default_rng(3).choice(np.arange(1, T.size - 1), 60, replace=False)
    values[filled] = (values[filled - 1] + values[filled + 1]) / 2
    values[filled[::2]] += 0.3 * step
    assert resolution_of(values) == pytest.approx(step, rel=1e-3)


def test_a_step_that_the_rig_file_does_not_give_is_the_runs() -> None:
    step = 2 * np.pi / 2**12
    run = Run(T, recorded(step, 0.1), 0 * T, 500.0)
    silent = RigFile.parse("l1 = 0.3")
    rig = resolved(silent, run)
    assert rig.sensor.phi_lsb == float(f"{step:.4g}") and isinstance(rig.sensor.phi_lsb, Unset)
    assert resolution_note(silent, rig) == ("phi moves in steps of 0.001534 rad: taken as phi_lsb, which is not given",)
    given = RigFile.parse("l1 = 0.3\n[sensor]\nphi_lsb = 1e-4")
    assert resolved(given, run) == given and resolution_note(given, given) == ()
    for other in (np.degrees(run.phi), 0.1 * SWING, recorded(2 * np.pi / 2**14, 0.1)):  # coarse, none, the default
        assert resolved(silent, Run(T, other, 0 * T, 500.0)) is silent
