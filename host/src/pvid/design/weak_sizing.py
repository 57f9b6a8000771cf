"""Sizes of the weak form's design for a rig: window, test functions, decimation and filters follow its two modes.

Measured on random rigs and on the standard rig: a window of 1.3 slow periods, test functions up to 1.5 times the fast
mode's frequency, some 200 decimated samples a window, a pass band up to 4.5 times the fast mode. Where the modes lie
so far apart that the functions would be too many, the window is shortened, but not below 0.8 slow periods.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design import decimator
from pvid.design.decimator import Decimator
from pvid.models.kapitza.modes import modes_hz
from pvid.settings.tables import WeakSizes

Float = npt.NDArray[np.float64]

_PERIODS = 1.3
_LEAST_PERIODS = 0.8
_BAND = 1.5  # frequency of the last test function over that of the fast mode
_FEWEST = 8
_SAMPLES = 200
# Edge of the pass band over the fast mode's frequency: of a guess, which may be 1.5 times too slow, and of an estimate.
_PASS = 7.0
PASS = 4.5
PASS_MOST = 0.3  # and over the decimated rate
# A run must hold this many windows' lengths, so that at least four half-overlapping ones are judged.
_WINDOWS_A_RUN = 2.6
# Filters twice as bad as wanted are taken rather than longer ones than a core has room for by default.
_BAD = 2.0
_MIN_WINDOW = 9


@dataclass(frozen=True)
class Bounds:
    """Compile-time bounds of the core (pvid/config.h); the defaults are the core's own."""

    taps: int = 81
    decimation: int = 32
    window: int = 251
    functions: int = 16


# Bounds of the host's build, and of a board's image whose rig needs more than the defaults.
HOST = Bounds(taps=401, decimation=64)


@dataclass(frozen=True)
class Sizes:
    """Sizes of a design; None: from the modes.

    Attributes
    ----------
    window_s : length of a window [s]
    functions : test functions a window, K
    decimation : samples per decimated sample, D
    taps : length of the front end's filters [samples], odd
    pass_hz : edge of their pass band [Hz]
    """

    window_s: float | None = None
    functions: int | None = None
    decimation: int | None = None
    taps: int | None = None
    pass_hz: float | None = None


@dataclass(frozen=True)
class Sized:
    """Sizes that are all known, the filters that go with them, and W, the decimated samples of a window (odd)."""

    functions: int
    decimation: int
    window: int
    front: Decimator


def slow_and_fast_hz(p: npt.NDArray[np.float64]) -> tuple[float, float]:
    """The modes of p = (w, d1, d2) [Hz]; where p is no pendulum's, both in the middle."""
    both = modes_hz(p)
    if len(both) == 2 and both[0] > 0:
        return both[0], both[1]
    middle = math.sqrt(abs(p[0] * p[1]) / 2) / (2 * math.pi)
    return middle, middle


def sized(p: Float, sample_rate: float, given: Sizes, bounds: Bounds = HOST) -> Sized:
    """Sizes for a rig, of which `given` fixes some.

    Parameters
    ----------
    p : (w [1/s^2], d1, d2), rough
    sample_rate : [Hz]
    given : what the rig file fixes
    bounds : of the core the tables are for

    Raises
    ------
    PvidError
        Naming the size that exceeds the core's bounds.
    """
    slow, fast = slow_and_fast_hz(p)
    window_s = given.window_s if given.window_s is not None else _window_s(slow, fast, bounds)
    if not (math.isfinite(window_s) and window_s > 0):
        raise PvidError(f"window_s must be a positive number of seconds, not {window_s:g}")
    functions = given.functions
    if functions is None:
        functions = min(max(math.ceil(2 * window_s * _BAND * fast), _FEWEST), bounds.functions)
    decimation = given.decimation
    if decimation is None:
        least = math.ceil(window_s * sample_rate / (bounds.window - 1))
        wanted = max(round(window_s * sample_rate / _SAMPLES), least, 1)
        decimation = min(wanted, bounds.decimation)
        if given.window_s is None:
            window_s = min(window_s, (bounds.window - 1) * decimation / sample_rate)
    _require("decimation", decimation, 1, bounds.decimation, "PVID_MAX_DECIMATION")
    _require("functions", functions, 4, bounds.functions, "PVID_MAX_FUNCTIONS")
    window = 2 * round(min(window_s * sample_rate / (2 * decimation), 1e9)) + 1
    if not _MIN_WINDOW <= window <= bounds.window:
        raise PvidError(
            f"window_s = {window_s:g} s is {window} samples after decimation by {decimation}, and the core "
            f"takes {_MIN_WINDOW} to {bounds.window} (PVID_MAX_WEAK_WINDOW): change window_s or decimation"
        )
    edge_hz = given.pass_hz if given.pass_hz is not None else _PASS * fast
    edge = min(edge_hz / sample_rate, PASS_MOST / decimation)
    return Sized(functions, decimation, window, _front(decimation, edge, given.taps, bounds))


def decimation_of(p: Float, sample_rate: float, given: Sizes, bounds: Bounds = HOST) -> int:
    """Samples per decimated sample of `sized`."""
    return sized(p, sample_rate, given, bounds).decimation


def pass_hz_of(p: Float) -> float:
    """Edge of the pass band [Hz] for a p that is known to a few per cent."""
    return PASS * slow_and_fast_hz(p)[1]


def bounds_of(design: WeakSizes) -> dict[str, int]:
    """Macros of pvid/config.h with the values that just hold a design."""
    return {
        "PVID_MAX_TAPS": design.taps,
        "PVID_MAX_DECIMATION": design.decimation,
        "PVID_MAX_WEAK_WINDOW": design.window,
        "PVID_MAX_FUNCTIONS": design.functions,
    }


def raised_bounds(design: WeakSizes) -> dict[str, int]:
    """Those of `bounds_of` that exceed the core's defaults."""
    default = bounds_of(Bounds())
    return {macro: needed for macro, needed in bounds_of(design).items() if needed > default[macro]}


def window_for_run(p: Float, duration_s: float, bounds: Bounds = HOST) -> float | None:
    """Length of a window [s] that a run of `duration_s` [s] holds often enough; None where the modes' own does."""
    longest = duration_s / _WINDOWS_A_RUN
    return longest if longest < _window_s(*slow_and_fast_hz(p), bounds) else None


def _window_s(slow: float, fast: float, bounds: Bounds) -> float:
    window_s = _PERIODS / slow
    if 2 * window_s * _BAND * fast > bounds.functions:
        window_s = max(bounds.functions / (2 * _BAND * fast), _LEAST_PERIODS / slow)
    return window_s


def _front(decimation: int, edge: float, taps: int | None, bounds: Bounds) -> Decimator:
    if taps is not None:
        _require("taps", taps, decimator.MIN_TAPS, bounds.taps, "PVID_MAX_TAPS")
        if taps % 2 == 0:
            raise PvidError(f"taps must be odd, not {taps}")
        return decimator.pair(taps, decimation, edge)
    front = decimator.shortest(decimation, edge, min(Bounds.taps, bounds.taps))
    if front.badness > _BAD and bounds.taps > Bounds.taps:
        return decimator.shortest(decimation, edge, bounds.taps)
    return front


def _require(name: str, value: int, low: int, high: int, macro: str) -> None:
    if not low <= value <= high:
        limit = f" ({macro} of the core)" if value > high else ""
        raise PvidError(f"{name} must be {low} to {high}{limit}, not {value}")
