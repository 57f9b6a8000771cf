"""Wild samples and jumps of a signal are found; what a drive does by itself is not."""

import numpy as np
import numpy.typing as npt
import pytest

from pvid.rig.breaks import breaks

Float = npt.NDArray[np.float64]

NOISE = 1e-5
T = np.arange(20_000) / 1000.0


def noisy(y: Float) -> Float:
    found: Float = y + np.random.default_rng(1).normal(0.0, NOISE, len(y))
    return found


def swept(low: float, high: float) -> Float:
    found: Float = 5e-3 * np.sin(2 * np.pi * (low * T + (high - low) * T**2 / (2 * T[-1])))
    return found


STILL = np.zeros(len(T))
DRIVES = {
    "tones": 5e-3 * np.sin(2 * np.pi * 2.3 * T) + 4e-3 * np.sin(2 * np.pi * 4.1 * T + 1.0),
    "sweep": swept(1.0, 100.0),
    "onset": np.where(T > 7, 5e-3 * (1 - np.cos(2 * np.pi * 20 * (T - 7))), 0.0),
    "triangle": 5e-3 * 2 / np.pi * np.arcsin(np.sin(2 * np.pi * 3 * T)) * 0.3,
    "still": STILL,
}


@pytest.mark.parametrize("name", DRIVES)
def test_a_drive_has_no_breaks(name: str) -> None:
    assert not breaks(noisy(DRIVES[name]), 1000, NOISE).any()
    assert not breaks(DRIVES[name], 1000, NOISE).any()


def test_a_wild_sample_and_a_jump_are_found_where_they_are() -> None:
    y = noisy(DRIVES["tones"])
    y[5000] += 1e-2
    y[12_000:] += 1e-2
    found = np.flatnonzero(breaks(y, 1000, NOISE))
    assert found.tolist() == [*range(4998, 5003), *range(11_998, 12_002)]


def test_missing_samples_are_no_breaks() -> None:
    y = noisy(DRIVES["tones"])
    y[3000:5500] = np.nan
    y[7000] = np.nan
    assert not breaks(y, 1000, NOISE).any()
    assert not breaks(y[:3], 1000, NOISE).any()
