"""What a weak form is made with: window, test functions, front end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from pvid.base.errors import PvidError
from pvid.oracle.weak.filters import at_samples, compensator, edge_of, nodes_of, polynomial_weights
from pvid.oracle.weak.functions import Float, TestFunctions

_BAND = 1.2  # highest frequency of the motion over that of the test functions


Reversals = Literal["located", "averaged", "decided", "soft"]
DOUBT = 20  # PVID_WEAK_DOUBT


@dataclass(frozen=True)
class WeakDesign:
    """Design of a weak form.

    Attributes
    ----------
    sample_rate : [Hz]
    window_s : [s]; windows overlap by half
    functions : K
    power : n of sin^n, even; at least 2 above the highest order of the rows
    decimation : raw samples a step
    taps, degree : of the polynomial smoother of values; 1 tap: none
    rate_taps, rate_degree : of the polynomial that gives the derivatives; 0 taps: those of the values
    reversals : how sgn(v) is summed: "located" finds when v changes sign and gives the samples around it the weights of
        the exact integral; "averaged" takes the mean of sgn over a step, v linear there; "decided" likewise, without
        the windows in which a sign is in doubt in more than a part 1 / DOUBT of the steps of a half; "soft" is tanh(v /
        soft)
    soft : width of the soft sign [unit of the velocity]
    joint : whiten all row kinds together; noise that they share then counts once
    comb : values and derivatives from block sums and compensators at the steps (pvid.oracle.weak.filters) in place of
        polynomials at the samples, with about as many taps. Needs a decimation above 1
    """

    sample_rate: float
    window_s: float
    functions: int = 16
    power: int = 6
    decimation: int = 1
    taps: int = 1
    degree: int = 6
    rate_taps: int = 21
    rate_degree: int = 3
    reversals: Reversals = "located"
    soft: float = 0.0
    joint: bool = False
    comb: bool = False

    def __post_init__(self) -> None:
        for name, taps, degree in (("taps", self.taps, self.degree), ("rate_taps", self.rate_taps, self.rate_degree)):
            if taps > 1 and (taps % 2 == 0 or taps <= degree):
                raise PvidError(f"{name} of a design must be odd and above the degree {degree}, not {taps}")
        if self.hop < self.highest + 1:
            raise PvidError(
                f"a window of {self.window_s:g} s has {2 * self.hop} steps, too few for {self.functions} functions:"
                " make it longer, decimate less, or take fewer functions"
            )
        if self.reversals == "soft" and self.soft <= 0:
            raise PvidError("a soft sign needs a width above 0")
        if self.comb and self.decimation < 2:
            raise PvidError("block sums need a decimation above 1")

    @property
    def dt(self) -> float:
        """Step of the decimated samples [s]."""
        return self.decimation / self.sample_rate

    @property
    def hop(self) -> int:
        """Steps from window to window, half a window."""
        return max(2, round(self.window_s / (2 * self.dt)))

    @property
    def highest(self) -> int:
        """Highest harmonic."""
        return self.functions // 2 + self.power // 2

    def weights(self, order: int) -> Float:
        """Weights of the filter that gives the derivative of this order from raw samples [1 / s^order]."""
        if self.comb:
            return at_samples(self.decimation, tuple(self.step_weights(order)))
        if order == 0:
            return polynomial_weights(self.taps, self.degree, 0)
        taps, degree = self._polynomial_of(order)
        if taps == 1:
            raise PvidError("a model that needs a derivative needs rate_taps or taps above 1")
        return polynomial_weights(taps, max(degree, order), order) * self.sample_rate**order

    def step_weights(self, order: int) -> Float:
        """Weights at the steps of the block sums; without a decimation those at the samples [1 / s^order].

        A compensator is about as long as the polynomial. Its band reaches a little above the test functions', but not
        above where the polynomial of as many taps is right.
        """
        if not self.comb:
            return self.weights(order)
        taps, degree = self._polynomial_of(order)
        count = nodes_of(order, degree)
        half = max(round((taps + 1 - 2 * self.decimation) / (2 * self.decimation)), count)
        band = _BAND * self.highest / self.window_s
        if taps > 1:
            band = min(band, edge_of(taps, max(degree, order), order) * self.sample_rate)
        return np.array(compensator(self.decimation, self.sample_rate, order, half, band, count))

    def _polynomial_of(self, order: int) -> tuple[int, int]:
        """Taps and degree."""
        rates = order > 0 and self.rate_taps > 1
        return (self.rate_taps, self.rate_degree) if rates else (self.taps, self.degree)

    @property
    def test_functions(self) -> TestFunctions:
        """Those of this design: kept for the last few designs, since their tables are large and designs are many."""
        return _functions(self.functions, self.power, self.hop, self.dt)


_functions = lru_cache(maxsize=16)(TestFunctions)
