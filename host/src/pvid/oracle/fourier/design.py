"""What a weak form is made with: window, test functions, front end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from pvid.base.errors import PvidError
from pvid.oracle.fourier.functions import TestFunctions


@dataclass(frozen=True)
class FourierDesign:
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
    reversals
        how sgn(v) is summed: "located" finds when v changes sign and gives the samples around it the weights of the
        exact integral; "averaged" takes the mean of sgn over a step, v linear there; "soft" is tanh(v / soft)
    soft : width of the soft sign [unit of the velocity]
    joint : whiten all row kinds together; noise that they share then counts once
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
    reversals: Literal["located", "averaged", "soft"] = "located"
    soft: float = 0.0
    joint: bool = False

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

    @cached_property
    def test_functions(self) -> TestFunctions:
        """Those of this design."""
        return TestFunctions(self.functions, self.power, self.hop, self.dt)
