"""FIR banks against exact rational arithmetic and against polynomials whose derivatives are known."""

from fractions import Fraction
from math import factorial

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import legendre
from scipy.signal import savgol_coeffs

from pvid.base.errors import PvidError
from pvid.design.fir import ORDERS, FirBank, finite_difference, savitzky_golay


def exact_taps(half: int, degree: int, order: int) -> list[Fraction]:
    """Savitzky-Golay taps for the points -half..half by the normal equations in rational arithmetic."""
    points = range(-half, half + 1)
    n = degree + 1
    rows = [[Fraction(sum(x ** (i + j) for x in points)) for j in range(n)] for i in range(n)]
    for i, row in enumerate(rows):
        row.append(Fraction(factorial(order)) if i == order else Fraction(0))
    for column in range(n):  # Gauss-Jordan; the matrix is positive definite, so no pivoting
        pivot = rows[column][column]
        rows[column] = [value / pivot for value in rows[column]]
        for i in range(n):
            if i != column and rows[i][column]:
                factor = rows[i][column]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[column], strict=True)]
    coefficients = [row[-1] for row in rows]
    return [sum((c * x**k for k, c in enumerate(coefficients)), Fraction(0)) for x in points]


def worst_tap_error(bank: FirBank, order: int) -> float:
    """Largest error of a folded tap, relative to the largest tap."""
    taps = exact_taps(bank.half, bank.degree, order)
    largest = max(abs(tap) for tap in taps)
    taps = taps[bank.half + 1 :]
    errors = (abs(Fraction(float(w)) - tap) for w, tap in zip(bank.weights[order], taps, strict=True))
    return float(max(errors) / largest)


@pytest.mark.parametrize(("window", "degree"), [(5, 4), (7, 4), (13, 12), (21, 6), (61, 6), (321, 10), (401, 12)])
def test_savitzky_golay_equals_rational_arithmetic(window: int, degree: int) -> None:
    bank = savitzky_golay(window, degree)
    for order in range(ORDERS):
        # The Legendre basis on equidistant points has a condition below 1e3 up to degree 12.
        assert worst_tap_error(bank, order) < 2e-13


def test_scipy_is_wrong_where_this_design_is_needed() -> None:
    """The reason not to use scipy.signal.savgol_coeffs (theory.md 5); drop ours if this ever fails."""
    scipy_taps = savgol_coeffs(321, 10, deriv=4, use="dot")[161:]
    taps = [float(tap) for tap in exact_taps(160, 10, 4)[161:]]
    ours = savitzky_golay(321, 10).weights[4]
    scale = np.abs(taps).max()
    assert np.abs(scipy_taps - taps).max() / scale > 1e-6
    assert np.abs(ours - taps).max() / scale < 2e-13


BANKS = [
    finite_difference(),
    finite_difference(7),
    savitzky_golay(5, 4),
    savitzky_golay(31, 6, 3),
    savitzky_golay(101, 9),
    savitzky_golay(321, 10),
    savitzky_golay(201, 12),
]


BLOCKS = [savitzky_golay(35, 10, 1, 9), savitzky_golay(31, 12, 2, 7)]


@pytest.mark.parametrize("bank", [*BANKS, *BLOCKS], ids=lambda b: f"{b.kind}-{b.window}-{b.degree}-{b.stride}")
def test_exact_on_polynomials_up_to_the_degree(bank: FirBank) -> None:
    # Time runs over -1..1 in one window, so every monomial is of size 1.
    rate = float(bank.delay)
    t = np.arange(-bank.delay, bank.delay + 1) / rate
    for degree in range(bank.degree + 1):
        derivatives = bank.apply(t**degree, rate)[:, 0]
        for order in range(ORDERS):
            expected = float(factorial(degree)) if degree == order else 0.0
            # Rounding of the sum: half a dozen eps times the sum of |taps| in units of this time.
            gain = float(np.sum(np.abs(bank.weights[order]))) * (rate / (bank.stride * bank.every)) ** order
            assert abs(derivatives[order] - expected) < 4e-15 * (4.0 + 4.0 * gain), (degree, order)


@pytest.mark.parametrize("bank", BANKS, ids=lambda b: f"{b.kind}-{b.window}-{b.degree}-{b.stride}")
def test_a_constant_and_a_line_are_exact_in_bits(bank: FirBank) -> None:
    derivatives = bank.apply(np.full(bank.window + 3, 0.1), 1000.0)
    assert derivatives.shape == (ORDERS, 4)
    assert np.all(derivatives[0] == 0.1)
    assert np.all(derivatives[1:] == 0.0)


def kernel_of(bank: FirBank, order: int) -> npt.NDArray[np.float64]:
    """The whole filter of an order on the samples of a window, per sample^order."""
    unit = np.eye(bank.window)
    taps = np.array([bank.apply(one, 1.0)[order, 0] for one in unit])
    assert taps.shape == (bank.window,)
    return taps


@pytest.mark.parametrize("order", [0, 2, 3, 4])
def test_blocks_add_at_most_a_seventh_to_the_noise(order: int) -> None:
    """35 points of 9 samples against all 315 samples, degree 12: 2 % in the value, 14 % in the fourth derivative."""
    noise = [np.linalg.norm(kernel_of(bank, order)) for bank in (savitzky_golay(35, 12, 1, 9), savitzky_golay(315, 12))]
    assert 1.0 < noise[0] / noise[1] < 1.15


def test_a_block_is_odd() -> None:
    with pytest.raises(PvidError, match="must be odd, not 8 samples"):
        savitzky_golay(35, 10, 1, 8)


def test_finite_differences_converge_at_their_order() -> None:
    """Halving h divides the error by 2^4 in orders 1 and 2 and by 2^2 in orders 3 and 4."""
    rate, strides = 1000.0, (100, 50)
    t = np.arange(-200, 201) / rate
    expected = [np.sin(0.5), np.cos(0.5), -np.sin(0.5), -np.cos(0.5), np.sin(0.5)]
    errors = []
    for stride in strides:
        bank = finite_difference(stride)
        derivatives = bank.apply(np.sin(t + 0.5), rate)
        errors.append(np.abs(derivatives[:, derivatives.shape[1] // 2] - expected))
    ratio = errors[0][1:] / errors[1][1:]
    assert errors[0][0] == 0.0
    # The next term of the error is h^2 times smaller, h = 0.1 s: a per cent of the ratio.
    np.testing.assert_allclose(ratio, [16.0, 16.0, 4.0, 4.0], rtol=0.02)


@given(half=st.integers(6, 60), degree=st.integers(4, 12), stride=st.integers(1, 5), rate=st.floats(1.0, 1e4))
@settings(max_examples=40)
def test_stride_and_rate_only_scale_time(half: int, degree: int, stride: int, rate: float) -> None:
    bank = savitzky_golay(2 * half + 1, degree, stride)
    dense = savitzky_golay(2 * half + 1, degree)
    random = np.random.default_rng(half)
    x = random.standard_normal(bank.window + 5 * stride)
    strided = bank.apply(x, rate)[:, ::stride]
    plain = dense.apply(x[::stride], rate / stride)
    np.testing.assert_array_equal(strided[:, : plain.shape[1]], plain)


def test_bias_on_a_sine_is_that_of_the_first_polynomial_left_out() -> None:
    """Of sin(omega t) the window loses the Taylor terms above the degree; the first one rules the bias.

    x^n minus its projection is the monic Legendre polynomial (in the limit of many points), so the bias of
    order k, relative to omega^k, is (omega h)^(n-k) / n! P_n^(k)(0) / lead(P_n), n = 11 (odd k) or 12.
    """
    bank = savitzky_golay(321, 10)
    rate, omega = 1000.0, 2.0 * np.pi * 2.56  # the fast mode of the standard rig
    t = np.arange(2000) / rate
    derivatives = bank.apply(np.sin(omega * t), rate)
    centre = t[bank.delay : -bank.delay]
    phases = omega * centre + np.pi / 2 * np.arange(ORDERS)[:, np.newaxis]  # d sin = sin(. + pi/2)
    for order in range(ORDERS):
        bias = np.abs(derivatives[order] / omega**order - np.sin(phases[order])).max()
        n = 11 if order % 2 else 12
        unit = np.eye(n + 1)[n]
        at_zero = legendre.legval(0.0, legendre.legder(unit, order))
        remainder = abs(at_zero / legendre.leg2poly(unit)[-1])
        expected = (omega * bank.delay / rate) ** (n - order) / factorial(n) * remainder
        # The next term is (omega h)^2 / (n+1)(n+2), 4 %, of this one, times a ratio of Legendre values near
        # 2; 321 points instead of a continuum change it by one or two per cent.
        assert bias == pytest.approx(expected, rel=0.1), order


@pytest.mark.parametrize(
    ("window", "degree", "stride"),
    [(6, 4, 1), (5, 5, 1), (3, 4, 1), (31, 3, 1), (31, 13, 1), (31, 6, 0), (0, 4, 1), (-7, 4, 1)],
)
def test_impossible_designs_are_refused(window: int, degree: int, stride: int) -> None:
    with pytest.raises(PvidError):
        savitzky_golay(window, degree, stride)


def test_a_run_shorter_than_the_window_is_refused() -> None:
    x: npt.NDArray[np.float64] = np.zeros(20)
    with pytest.raises(PvidError, match="20 samples do not fill .* window of 21"):
        savitzky_golay(21, 6).apply(x, 1000.0)
    with pytest.raises(PvidError, match="stride"):
        finite_difference(0)


def test_the_cores_tables_are_the_rounded_contiguous_ones() -> None:
    bank = savitzky_golay(31, 6)
    assert bank.weights32.shape == (ORDERS, 15) and bank.weights32.dtype == np.float32
    assert bank.weights32.flags.c_contiguous
    # Rounding to nearest: half an ulp, 2^-24 relative.
    np.testing.assert_allclose(bank.weights32, bank.weights, rtol=2.0**-24)
