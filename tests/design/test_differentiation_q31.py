"""Integer derivatives: the C core against exact sums of counts and against the bank in float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.fir import ORDERS, FirBank, finite_difference, savitzky_golay
from pvid.design.fir_q31 import integer_bank, largest_sums
from pvid.settings.tables import FirBankQ31

PHI_MAX, Y_MAX = 83443, 6000  # 0.5 rad of 20 bits, 30 mm of 5 um
BANKS = {
    "five points": (finite_difference(), 0.02),
    "five points, stride 40": (finite_difference(40), 0.04),
    "241 points, degree 12": (savitzky_golay(241, 12), 0.001),
    "81 points, degree 10, stride 4": (savitzky_golay(81, 10, 4), 0.004),
    "35 points of nine samples, degree 10": (savitzky_golay(35, 10, 1, 9), 0.009),
}
Counts = npt.NDArray[np.int64]


def bank_of(name: str) -> tuple[FirBank, FirBankQ31, float]:
    bank, point = BANKS[name]
    return bank, integer_bank(bank, PHI_MAX, Y_MAX, 36.0 * point), point


def hostile(ticks: int) -> tuple[Counts, Counts]:
    """Square waves and random counts at full scale, steps, a stuck sensor, nothing."""
    random = np.random.default_rng(3)
    t = np.arange(ticks)
    phi = random.integers(-PHI_MAX, PHI_MAX + 1, ticks)
    y = Y_MAX * np.where(t // 3 % 2, 1, -1)
    phi[1000:2000] = PHI_MAX * np.where(t[1000:2000] % 2, 1, -1)
    phi[2000:2600] = PHI_MAX
    phi[2600:2700] = -PHI_MAX
    phi[2700:] = 0
    return phi, y


def taps_of(bank: FirBankQ31, order: int) -> Counts:
    """Integer weights of an order on the points of a window [points], the oldest first."""
    folded = bank.weights[order].astype(np.int64)
    centre = (bank.centre if order == 0 else 0) - (0 if order % 2 else 2 * folded.sum())
    taps = np.zeros(2 * bank.half * bank.stride + 1, np.int64)
    taps[:: bank.stride] = np.concatenate([(-1 if order % 2 else 1) * folded[::-1], [centre], folded])
    return taps


@pytest.mark.parametrize("name", BANKS)
def test_hostile_counts_give_the_exact_sums_rounded_once(native: Native, name: str) -> None:
    _, bank, _ = bank_of(name)
    d_phi, d_y, ready = native.derivatives_q31(bank, *hostile(3000))
    assert np.array_equal(np.flatnonzero(ready), np.arange(bank.window - 1, 3000, bank.every))
    d, shift = (d_phi, d_y), (bank.phi_shift, bank.y_shift)
    for counts, found, shifts, first in zip(hostile(3000), d, shift, (0, 2), strict=True):
        points = counts[: len(counts) // bank.every * bank.every].reshape(-1, bank.every).sum(axis=1)
        for column, by in enumerate(shifts):
            sums = np.correlate(points, taps_of(bank, first + column), "valid")
            assert np.array_equal(found[ready, column], (sums + ((1 << by) >> 1)) >> by), column
        assert not found[~ready].any() and np.abs(found.astype(np.int64)).max() <= 2**30


@pytest.mark.parametrize("name", BANKS)
def test_the_proof_names_the_worst_counts(native: Native, name: str) -> None:
    """What interval analysis says is the largest sum is reached by the counts with the signs of the weights."""
    _, bank, _ = bank_of(name)
    points = np.arange(2 * bank.half + 1) * bank.stride * bank.every
    samples = points[:, np.newaxis] + np.arange(bank.block)
    for order, largest in enumerate(largest_sums(bank.weights, bank.centre, PHI_MAX * bank.block)):
        taps = taps_of(bank, order)[:: bank.stride]
        phi = np.zeros(bank.window, np.int64)
        phi[samples] = PHI_MAX * np.sign(taps)[:, np.newaxis]
        d_phi, _, ready = native.derivatives_q31(bank, phi, np.zeros(bank.window, np.int64))
        assert ready[-1]
        assert d_phi[-1, order] == (largest + (1 << bank.phi_shift[order] >> 1)) >> bank.phi_shift[order]


@pytest.mark.parametrize("name", BANKS)
@pytest.mark.parametrize("frequency", [0.742, 2.56, 4.1])
def test_motion_is_differentiated_as_in_float64(native: Native, name: str, frequency: float) -> None:
    """In real numbers of the counts: what integer weights and one rounding do to each order."""
    exact, bank, point = bank_of(name)
    ticks = 4 * bank.window
    t = np.arange(ticks) * point / (bank.stride * bank.every)
    phi = np.rint(15000 * np.sin(2 * np.pi * frequency * t + 0.4)).astype(np.int64)
    y = np.rint(1000 * np.sin(2 * np.pi * frequency * t + 2.4)).astype(np.int64)
    d_phi, d_y, ready = native.derivatives_q31(bank, phi, y)
    tau = 2.0**bank.tau_bits
    for counts, integers, bits, orders in (
        (phi, d_phi, bank.phi_bits, range(5)),
        (y, d_y, bank.y_bits, range(2, 5)),
    ):
        expected = exact.apply(counts.astype(np.float64), float(bank.stride * bank.every))
        for column, order in enumerate(orders):
            ours = integers[ready, column] * 2.0**-bits / bank.denominator
            wanted = expected[order] * tau**order
            # half a unit of rounding; weights of 12 bits, shaped, are worth 20 to motion (counts' noise sees them bare)
            unit = 0.5 * 2.0**-bits / bank.denominator
            noise = 0.3 * np.sqrt(2 * np.sum(exact.weights[order] ** 2)) * tau**order * 2e-3
            largest = np.abs(counts).max() * (2 * np.pi * frequency * point * tau) ** order
            assert np.abs(ours - wanted).max() <= 1.01 * unit + 5e-6 * largest + 6 * noise, order


def test_five_points_are_exact() -> None:
    exact, bank, _ = bank_of("five points")
    assert np.array_equal(bank.weights, 12 * exact.weights)
    assert set(bank.phi_shift) == set(bank.y_shift) == {0}
    assert (bank.phi_bits, bank.y_bits, bank.tau_bits, bank.centre) == (0, 0, 0, 12)


def test_margins_are_positive_or_the_design_is_refused() -> None:
    for name in BANKS:
        _, bank, _ = bank_of(name)
        assert min(bank.margins.values()) >= 0
        for order in range(ORDERS):
            reach = PHI_MAX * (2 if order % 2 else 4)
            bits = 31 if bank.block == 1 else 62  # the sum of a block is multiplied in 64 bits
            assert np.abs(bank.weights[order].astype(np.int64)).max() * reach * bank.block < 2**bits
    with pytest.raises(PvidError, match="too many for the derivative"):
        integer_bank(finite_difference(), 2**24, Y_MAX, 0.1)
    with pytest.raises(PvidError, match="phi_range is 3 counts"):
        integer_bank(finite_difference(), 3, Y_MAX, 0.1)


def test_the_core_refuses_a_bank_that_could_overflow(native: Native) -> None:
    _, bank, _ = bank_of("241 points, degree 12")
    broken = FirBankQ31(**{**vars(bank), "phi_shift": (*bank.phi_shift[:4], bank.phi_shift[4] - 1)})
    with pytest.raises(PvidError, match="refused the bank: bad shift"):
        native.derivatives_q31(broken, np.zeros(10), np.zeros(10))


def test_full_scale_alternating_counts_reach_the_limit_of_five_points(native: Native) -> None:
    bank = integer_bank(finite_difference(), PHI_MAX, Y_MAX, 0.72)
    phi = PHI_MAX * np.array([1, -1, 1, -1, 1])
    d_phi, _, _ = native.derivatives_q31(bank, phi, np.zeros(5))
    assert d_phi[-1, 4] == 192 * PHI_MAX
