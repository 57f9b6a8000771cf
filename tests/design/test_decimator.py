"""The front end's filters: what they promise against a direct FFT of their taps, what they keep exactly, refusals."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import savgol_coeffs

from pvid.base.errors import PvidError
from pvid.design.decimator import GOOD_FOLDED_GAIN, GOOD_PASS_ERROR, MIN_TAPS, Decimator, Fir, fir, pair, shortest

Float = npt.NDArray[np.float64]

# taps, decimation, edge [cycles per sample]: the standard rig's, that of 5 kHz, a bad one, and one without decimation
CASES = ((81, 9, 0.0115), (253, 43, 0.0023), (41, 9, 0.0115), (15, 1, 0.1))
_POINTS = 2**15  # of the FFT: steps of 3e-5 cycles a sample, a thirtieth of the narrowest pass band


def taps_of(one: Fir, order: int) -> Float:
    """All taps: those of x[c - half] to x[c + half]."""
    outer = one.weights
    centre = (1.0 if order == 0 else 0.0) - 2 * outer.sum()
    return np.concatenate([outer[::-1], [centre], outer])


def response(taps: Float) -> tuple[Float, Float]:
    """Frequencies [cycles per sample] and the response there of symmetric taps, by FFT."""
    half = len(taps) // 2
    padded = np.zeros(_POINTS)
    padded[: half + 1], padded[-half:] = taps[half:], taps[:half]
    spectrum = np.fft.rfft(padded)
    assert np.abs(spectrum.imag).max() < 1e-9 * np.abs(spectrum).max()
    return np.asarray(np.fft.rfftfreq(_POINTS), np.float64), np.asarray(spectrum.real, np.float64)


def wanted(frequency: Float, order: int) -> Float:
    return np.ones_like(frequency) if order == 0 else -((2 * math.pi * frequency) ** 2)


def folding(frequency: Float, decimation: int, edge: float) -> npt.NDArray[np.bool_]:
    """What decimation brings into the pass band."""
    nearest = np.round(frequency * decimation)
    return (np.abs(frequency - nearest / decimation) < edge) & (nearest > 0) & (frequency >= edge)


def folded_gain(taps: Float, order: int, decimation: int, edge: float) -> float:
    """rms gain there, over the wanted response at the edge."""
    frequency, found = response(taps)
    rms = np.sqrt(np.mean(found[folding(frequency, decimation, edge)] ** 2))
    return float(rms / np.abs(wanted(np.array([edge]), order)[0]))


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize(("taps", "decimation", "edge"), CASES)
def test_the_pass_error_is_that_of_the_taps(taps: int, decimation: int, edge: float, order: int) -> None:
    one = fir(taps, decimation, order, edge)
    frequency, found = response(taps_of(one, order))
    inside = frequency < edge
    scale = np.maximum(np.abs(wanted(frequency, order)), 0.02 * abs(wanted(np.array([edge]), order)[0]))
    error = np.abs(found - wanted(frequency, order)) / scale
    # most of it is at the edge, which the design looks at and the FFT only up to a step short of it
    assert float(error[inside].max()) == pytest.approx(one.pass_error, rel=0.25, abs=1e-9)


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize(("taps", "decimation", "edge"), CASES[:3])
def test_the_folded_gain_is_that_of_the_taps(taps: int, decimation: int, edge: float, order: int) -> None:
    one = fir(taps, decimation, order, edge)
    # the bands' edges, where the gain is largest, fall on different points of the two grids: 4 and more points a band
    assert folded_gain(taps_of(one, order), order, decimation, edge) == pytest.approx(one.folded_gain, rel=0.3)


def test_without_decimation_nothing_folds() -> None:
    assert fir(15, 1, 2, 0.1).folded_gain == 0.0


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize(("taps", "decimation", "edge"), CASES)
def test_polynomials_up_to_degree_five_pass_exactly(taps: int, decimation: int, edge: float, order: int) -> None:
    filter_taps = taps_of(fir(taps, decimation, order, edge), order)
    half = taps // 2
    t = np.arange(-half, half + 1) / half
    for power in range(6):  # degree 4, and 5 by symmetry
        expected = {0: 1.0 if power == 0 else 0.0, 2: 2.0 / half**2 if power == 2 else 0.0}[order]
        # taps of opposite signs cancel: rounding is relative to their sum of magnitudes
        assert filter_taps @ t**power == pytest.approx(expected, abs=1e-13 * np.abs(filter_taps).sum())


def test_a_savitzky_golay_filter_folds_ten_times_as_much() -> None:
    taps, decimation, edge = CASES[0]
    for order in (0, 2):
        usual = savgol_coeffs(taps, 6, deriv=order)
        ours = fir(taps, decimation, order, edge)
        assert folded_gain(np.asarray(usual), order, decimation, edge) > 10 * ours.folded_gain


def test_motion_passes_and_similar_noise_does_not() -> None:
    """Cosines through filter and decimation: one in the pass band, and one that decimation turns into it."""
    taps, decimation, edge = CASES[0]
    one = fir(taps, decimation, 0, edge)
    slow = 0.8 * edge
    n = np.arange(9 * 400 + taps)
    for frequency, low, high in ((slow, 1 - 2 * one.pass_error, 1 + 2 * one.pass_error), (1 / 9 - slow, 0.0, 0.03)):
        filtered = np.convolve(np.cos(2 * math.pi * frequency * n), taps_of(one, 0), "valid")[::decimation]
        turning = np.exp(-2j * math.pi * slow * decimation * np.arange(len(filtered)))
        window = np.hanning(len(filtered))
        amplitude = 2 * abs(np.sum(filtered * turning * window)) / window.sum()
        assert low <= amplitude <= high


def test_the_shortest_good_filters_are_taken() -> None:
    found = shortest(9, 0.0115, 401)
    assert found.badness <= 1
    assert found.smooth.pass_error <= GOOD_PASS_ERROR and found.second.pass_error <= GOOD_PASS_ERROR
    assert found.smooth.folded_gain <= GOOD_FOLDED_GAIN and found.second.folded_gain <= GOOD_FOLDED_GAIN
    for shorter in range(MIN_TAPS, round(0.84 * found.taps), 8):  # lengths grow by 19 % from one to the next
        assert pair(shorter | 1, 9, 0.0115).badness > 1


@pytest.mark.parametrize("most", [9, 40, 41])
def test_no_filter_is_longer_than_allowed_and_the_best_of_them_is_taken(most: int) -> None:
    found = shortest(9, 0.0115, most)
    assert isinstance(found, Decimator)
    assert found.taps <= most and found.taps % 2 == 1
    assert found.badness > 1  # none of them is good
    assert found.badness <= min(pair(taps, 9, 0.0115).badness for taps in (9, 9 + (most - 9) // 4 * 2, most - 1 | 1))


def test_noise_is_reduced_as_the_taps_say() -> None:
    taps, decimation, edge = CASES[0]
    weights = taps_of(fir(taps, decimation, 0, edge), 0)
    noise = np.random.default_rng(0).standard_normal(200_000)
    # of 200 000 values some 20 000 are independent: known to 0.5 %
    assert np.std(np.convolve(noise, weights, "valid")) == pytest.approx(np.linalg.norm(weights), rel=0.02)


@pytest.mark.parametrize(
    ("taps", "edge", "named"),
    [
        (80, 0.01, "taps must be odd and at least 9, not 80"),
        (7, 0.01, "taps must be odd and at least 9, not 7"),
        (81, 0.5, "below half the sample rate, not at 0.5"),
        (81, 0.0, "below half the sample rate, not at 0 "),
        (81, math.nan, "not at nan"),
    ],
)
def test_impossible_filter_is_refused_by_name(taps: int, edge: float, named: str) -> None:
    with pytest.raises(PvidError, match=named):
        fir(taps, 9, 0, edge)
