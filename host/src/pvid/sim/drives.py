"""Drives by name, for the choice of an excitation: the same inputs, other functions of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pvid.base.errors import PvidError
from pvid.models.drive import Chirp, Drive, RandomSteps, Sines, Steps, Sum

_SEED = 11  # of the pseudorandom sequences; an input's number is added
_GOLDEN = 2.3999632  # [rad] between the phases of the inputs


def _constant(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    return Sines((), offset=amplitude)


def _steps(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    """Up, off, down, off, each for a quarter of the longest period; another rhythm for each input."""
    return Steps((amplitude, 0.0, -amplitude, 0.0), 0.25 / low_hz * (1.0 + 0.3 * number))


def _sine(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    return Sines(((amplitude, low_hz * (1.0 + 0.3 * number), _GOLDEN * number),))


def _two_sines(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    apart = 1.0 + 0.17 * number
    middle = (low_hz * high_hz) ** 0.5
    return Sines(
        ((0.6 * amplitude, low_hz * apart, _GOLDEN * number), (0.4 * amplitude, middle * apart, 1.0 + _GOLDEN * number))
    )


def _sines_and_prbs(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    steps = RandomSteps(0.2 * amplitude, 0.5 / high_hz, _SEED + number)
    return Sum((_two_sines(0.8 * amplitude, low_hz, high_hz, number), steps))


def _chirp(amplitude: float, low_hz: float, high_hz: float, number: int) -> Drive:
    return Chirp(amplitude, low_hz, high_hz, 10.0 / low_hz**0.5 * (1.0 + 0.3 * number))


DRIVES: Mapping[str, Callable[[float, float, float, int], Drive]] = {
    "constant": _constant,
    "steps": _steps,
    "sine": _sine,
    "two sines": _two_sines,
    "two sines + PRBS": _sines_and_prbs,
    "chirp": _chirp,
}


def drive_named(name: str, amplitude: float, low_hz: float, high_hz: float, number: int = 0) -> Drive:
    """A drive of the list.

    Parameters
    ----------
    name : a key of DRIVES
    amplitude : largest value [SI]
    low_hz, high_hz : band of the excitation [Hz]
    number : of the input: the drives of several inputs differ
    """
    if name not in DRIVES:
        raise PvidError(f"{name} is no drive; known are {', '.join(DRIVES)}")
    if not 0.0 < low_hz < high_hz:
        raise PvidError(f"a drive's band goes from above 0 Hz to more, not from {low_hz:g} to {high_hz:g} Hz")
    return DRIVES[name](amplitude, low_hz, high_hz, number)
