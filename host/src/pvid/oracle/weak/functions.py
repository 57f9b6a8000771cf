"""Test functions sin^n(pi t/T) times harmonics, as short sums of exponentials, and what follows from that.

    chi_k(t) = sin^n(pi t/T) {1, cos(2 pi f (t/T - 1/2)), sin(2 pi f (t/T - 1/2))},   f = 1..M,   0 <= t <= T

Every chi_k^(m) is a sum of e^(2 pi i h t/T), |h| <= H = M + n/2, so that a window needs of each channel only the sums
S_h = sum psi(t_j) e^(2 pi i h t_j/T) (`half_sums`, `joined`), and `combine` turns them into K rows of any order m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def product(x: Float, matrix: Float) -> Float:
    """x @ matrix, as one product [..., columns of the matrix]."""
    return np.asarray((x.reshape(-1, x.shape[-1]) @ matrix).reshape(*x.shape[:-1], matrix.shape[-1]))


@dataclass(frozen=True)
class TestFunctions:
    """K test functions on windows of 2 hop steps of dt [s].

    Attributes
    ----------
    count : K; the first is the bell alone, then cosine and sine of each frequency
    power : n, even
    hop : samples of a half window
    dt : step [s]
    """

    __test__ = False  # not a test, whatever pytest reads in its name

    count: int
    power: int
    hop: int
    dt: float

    def __post_init__(self) -> None:
        if self.power < 2 or self.power % 2:
            raise ValueError(f"the power of a test function must be even and at least 2, not {self.power}")
        if self.count < 1 or self.hop < 2:
            raise ValueError("a window needs one test function and a half of two samples at least")

    @property
    def length(self) -> float:
        """T [s]."""
        return 2 * self.hop * self.dt

    @property
    def highest(self) -> int:
        """H, the highest harmonic."""
        return self.count // 2 + self.power // 2

    @property
    def resolved(self) -> bool:
        """Products of two test functions do not alias: their sums over the samples are integrals."""
        return 2 * self.highest < 2 * self.hop

    @cached_property
    def coefficients(self) -> Complex:
        """c [2 H + 1, K] with chi_k = sum_h c_hk e^(2 pi i h t/T), h = -H..H."""
        n, top = self.power, self.highest
        out = np.zeros((2 * top + 1, self.count), np.complex128)
        for j in range(n + 1):
            # Counted from the window's middle, sin^n is cos^n = sum_j C(n, j)/2^n e^(2 pi i h x), h = j - n/2.
            h, weight = j - n // 2, math.comb(n, j) / 2**n
            for k in range(self.count):
                f, factor = (k + 1) // 2, 0.5 if k % 2 else -0.5j
                if k == 0:
                    out[top + h, k] += weight
                else:
                    out[top + h + f, k] += weight * factor
                    out[top + h - f, k] += weight * np.conj(factor)
        # And from its start: x = t/T - 1/2.
        return out * ((-1.0) ** np.arange(-top, top + 1))[:, np.newaxis]

    @cached_property
    def rates(self) -> Float:
        """omega_h = 2 pi h/T [rad/s], h = -H..H."""
        return np.asarray(2 * math.pi * np.arange(-self.highest, self.highest + 1) / self.length)

    def combine(self, order: int) -> Float:
        """[2 H + 1, K]: sum chi^(order) psi = (S_0, Re S_1, Im S_1, Re S_2, ...) @ combine."""
        if order not in self._combined:
            self._combined[order] = self._combine(order)
        return self._combined[order]

    @cached_property
    def _combined(self) -> dict[int, Float]:
        return {}

    def _rated(self, order: int) -> Complex:
        """Coefficients of chi^(order)."""
        return np.asarray(self.coefficients * ((1j * self.rates) ** order)[:, np.newaxis])

    def _combine(self, order: int) -> Float:
        top, weights = self.highest, self._rated(order)
        out = np.empty((2 * top + 1, self.count))
        out[0] = np.real(weights[top])
        out[1::2] = np.real(weights[top + 1 :] + weights[:top][::-1])
        out[2::2] = -np.imag(weights[top + 1 :] - weights[:top][::-1])
        return out

    def gram(self, first: int, second: int) -> Float:
        """Sum over the samples of chi^(first) chi^(second)^T [K, K], from the harmonics alone."""
        if (first, second) not in self._grams:
            energy = np.full(2 * self.highest + 1, self.hop, np.float64)
            energy[0] = 2 * self.hop
            self._grams[first, second] = self.combine(first).T @ (energy[:, np.newaxis] * self.combine(second))
        return self._grams[first, second]

    def values(self, order: int) -> Float:
        """chi^(order) at the samples of a window [2 hop, K]."""
        turns = np.exp(1j * np.outer(self.dt * np.arange(2 * self.hop), self.rates))
        return np.asarray(np.real(turns @ self._rated(order)))

    @cached_property
    def _grams(self) -> dict[tuple[int, int], Float]:
        return {}

    def overlap(self, first: int, second: int) -> Float:
        """The same over the half that two neighbours share: chi^(first) of the earlier, chi^(second) of the later."""
        if (first, second) not in self._overlaps:
            if first not in self._earlier:
                self._earlier[first] = self.combine(first).T @ self._shared
            self._overlaps[first, second] = self._earlier[first] @ self.combine(second)
        return self._overlaps[first, second]

    @cached_property
    def _overlaps(self) -> dict[tuple[int, int], Float]:
        return {}

    @cached_property
    def _earlier(self) -> dict[int, Float]:
        return {}

    @cached_property
    def _shared(self) -> Float:
        """Sum of b_h(j + hop) b_g(j) over j < hop [2 H + 1, 2 H + 1]: b = (1, cos x, sin x, cos 2 x, ..), x = pi j/hop.

        From E(s) = sum e^(pi i s j/hop) at s = h + g and h - g: hop at 0, 0 at other even s, 2/(1 - e^(pi i s/hop))
        at odd ones.
        """
        top = self.highest
        s = np.arange(2 * top + 1)
        sums = np.zeros(2 * top + 1, np.complex128)
        sums[s % (2 * self.hop) == 0] = self.hop
        sums[1::2] = 2 / (1 - np.exp(1j * math.pi / self.hop * s[1::2]))
        h = np.arange(top + 1)
        plus, apart = sums[h[:, np.newaxis] + h], sums[np.abs(h[:, np.newaxis] - h)]
        apart = np.where(h[:, np.newaxis] < h, np.conj(apart), apart)
        out = np.empty((2 * top + 1, 2 * top + 1))
        out[0, 0] = self.hop
        cosine, sine = slice(1, None, 2), slice(2, None, 2)
        out[0, cosine], out[cosine, 0] = plus[0, 1:].real, plus[1:, 0].real
        out[0, sine], out[sine, 0] = plus[0, 1:].imag, plus[1:, 0].imag
        plus, apart = plus[1:, 1:], apart[1:, 1:]
        out[cosine, cosine], out[sine, sine] = (plus + apart).real / 2, (apart - plus).real / 2
        out[sine, cosine], out[cosine, sine] = (plus + apart).imag / 2, (plus - apart).imag / 2
        signs = np.repeat((-1.0) ** h, 2)[1:]  # of e^(pi i h (j + hop)/hop)
        return np.asarray(out * signs[:, np.newaxis])

    @cached_property
    def circle(self) -> Complex:
        """e^(2 pi i h j/(2 hop)) [hop, H + 1]: the factors of the samples of a half window."""
        places = np.outer(np.arange(self.hop), np.arange(self.highest + 1)) % (2 * self.hop)
        return np.asarray(np.exp(1j * math.pi / self.hop * np.arange(2 * self.hop))[places])

    def halves(self, x: Float) -> Float:
        """Whole half windows [..., halves, hop] of samples [..., n]; what is left over at the end is dropped."""
        whole = x.shape[-1] // self.hop
        return x[..., : whole * self.hop].reshape(*x.shape[:-1], whole, self.hop)

    def half_sums(self, halves: Float) -> Complex:
        """A_h [..., halves, H + 1] of half windows [..., halves, hop]; time counts from each half's start."""
        return product(halves, self.circle.view(np.float64)).view(np.complex128)

    def joined(self, first: Complex, second: Complex) -> Float:
        """S_h = A_h + (-1)^h B_h as (S_0, Re S_1, Im S_1, ...) [..., 2 H + 1] of two halves' sums [..., H + 1]."""
        whole = (first + second * (-1.0) ** np.arange(self.highest + 1)).view(np.float64)
        out = whole[..., 1:].copy()
        out[..., 0] = whole[..., 0]  # S_0 has no imaginary part
        return out

    def window_sums(self, x: Float) -> Float:
        """(S_0, Re S_1, Im S_1, ...) of every window of samples x [..., n]: [..., windows, 2 H + 1]."""
        halves = self.half_sums(self.halves(x))
        return self.joined(halves[..., :-1, :], halves[..., 1:, :])
