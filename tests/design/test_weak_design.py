"""The tables of the weak form: what they must be for the mathematics to hold, and what cannot be designed."""

from __future__ import annotations

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.design.weak import WeakDesign, design
from pvid.design.weak_sizing import Sizes
from pvid.models.kapitza.physical import linear

NOMINAL = linear(9.8, 0.1, 0.1, 0.3)


@pytest.fixture(scope="module")
def standard() -> WeakDesign:
    return design(0.3, 1000.0, NOMINAL)


def residual_filters(tables: WeakDesign, p: np.ndarray) -> np.ndarray:
    w, d1, d2 = p
    chi = tables.chi
    return np.asarray(chi[:, 2] + d1 * w * chi[:, 1] + d2 * w**2 * chi[:, 0])


def test_the_standard_design(standard: WeakDesign) -> None:
    assert (standard.taps, standard.decimation, standard.window, standard.functions) == (81, 9, 191, 10)
    assert standard.hop == 95
    assert standard.window_s == pytest.approx(1.71)


def test_residual_filters_are_orthonormal_at_the_nominal(standard: WeakDesign) -> None:
    filters = residual_filters(standard, NOMINAL)
    # the Gram's condition is about 1e5 before whitening: float64 leaves 1e-11
    np.testing.assert_allclose(filters.T @ filters, np.eye(standard.functions), atol=1e-9)


def test_functions_and_three_derivatives_vanish_at_the_ends(standard: WeakDesign) -> None:
    for order in range(2):  # chi and chi''; chi' and chi''' vanish with them: the next samples grow as x^6 and x^4
        largest = np.abs(standard.chi[:, order]).max(axis=0)
        assert (np.abs(standard.chi[[0, -1], order]) < 1e-9 * largest).all()
        assert (np.abs(standard.chi[[1, -2], order]) < 1e-2 * largest).all()


def test_every_function_is_even_or_odd(standard: WeakDesign) -> None:
    for k in range(standard.functions):
        for order in range(3):
            column = standard.chi[:, order, k]
            sign = 1 if k % 2 == 0 else -1
            np.testing.assert_allclose(column, sign * column[::-1], atol=1e-9 * np.abs(column).max())


def test_the_tables_are_derivatives_of_one_another(standard: WeakDesign) -> None:
    dt = standard.decimation / standard.sample_rate
    for order in range(2):
        lower, upper = standard.chi[:, order], standard.chi[:, order + 1]
        second = (lower[2:] - 2 * lower[1:-1] + lower[:-2]) / dt**2
        # the difference's own error, h^2/12 of a derivative two orders up: 10 functions have up to 13 waves a window
        # near its ends chi'''' carries the weights of its quadrature
        inner = slice(8, -8) if order else slice(None)
        assert np.abs(second - upper[1:-1])[inner].max() < 0.05 * np.abs(upper).max()


def test_gram_tables_give_the_gram_at_any_p(standard: WeakDesign) -> None:
    w, d1, d2 = p = np.array([20.0, 12.0, 3.0])
    weights = np.array([1, d1 * w, d2 * w**2, (d1 * w) ** 2, d1 * w * d2 * w**2, (d2 * w**2) ** 2])
    filters = residual_filters(standard, p)
    expected = (filters.T @ filters)[np.tril_indices(standard.functions)]
    np.testing.assert_allclose(weights @ standard.gram, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_smoothing_keeps_polynomials_and_reduces_noise(standard: WeakDesign) -> None:
    half = (standard.taps - 1) // 2
    t = np.arange(-half, half + 1) / half
    for power in range(6):  # degree 4, and 5 by symmetry
        x = t**power
        folded = (x[half + 1 :] - x[half]) + (x[half - 1 :: -1] - x[half])
        assert x[half] + standard.smooth @ folded == pytest.approx(1.0 if power == 0 else 0.0, abs=1e-12)
    noise = np.random.default_rng(0).standard_normal((20_000, standard.taps))
    folded = (noise[:, half + 1 :] - noise[:, [half]]) + (noise[:, half - 1 :: -1] - noise[:, [half]])
    smoothed = noise[:, half] + folded @ standard.smooth
    assert np.std(smoothed) == pytest.approx(standard.smoothing_gain, rel=0.02)  # four times 1/sqrt(2 * 20 000)


def test_overlap_is_what_noise_shares_between_neighbours(standard: WeakDesign) -> None:
    filters = residual_filters(standard, NOMINAL)
    noise = np.random.default_rng(1).standard_normal((20_000, standard.window + standard.hop))
    shared = (noise[:, : standard.window] @ filters).T @ (noise[:, standard.hop :] @ filters) / len(noise)
    largest = np.linalg.eigvalsh((shared + shared.T) / 2).max()
    assert 1 + 2 * largest == pytest.approx(standard.overlap, abs=0.1)  # 10 x 10 entries known to 0.7 %, twice


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (Sizes(functions=3), "functions"),
        (Sizes(functions=17), "functions"),
        (Sizes(window_s=17.0), "window_s"),  # 251 samples of 64
        (Sizes(window_s=0.005), "window_s"),
        (Sizes(window_s=5.0, decimation=8), "window_s"),
        (Sizes(decimation=65), "decimation"),
        (Sizes(decimation=0), "decimation"),
        (Sizes(taps=80), "taps"),
        (Sizes(taps=403), "taps"),
        (Sizes(taps=7), "taps"),
    ],
)
def test_impossible_design_is_refused_by_name(settings: Sizes, named: str) -> None:
    with pytest.raises(PvidError, match=named):
        design(0.3, 1000.0, NOMINAL, settings)


def test_an_exponent_that_leaves_no_zeros_at_the_ends_is_named() -> None:
    with pytest.raises(PvidError, match="exponent"):
        design(0.3, 1000.0, NOMINAL, exponent=3)


@pytest.mark.parametrize("rate", [125.0, 200.0, 250.0, 500.0, 2000.0, 4000.0, 5000.0])
def test_other_sample_rates_find_a_decimation(rate: float) -> None:
    tables = design(0.3, rate, NOMINAL)
    # a whole number near 200 samples a window: 100 to 125 Hz here
    assert 99.0 < rate / tables.decimation < 126.0
    assert tables.window_s == pytest.approx(1.71, rel=0.01)
