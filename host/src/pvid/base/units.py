"""Units of columns and of quantities of a model, and what one of them is in SI.

A unit is a product of powers: ``mN*m``, ``deg/s``, ``rev/min``, ``m/s^2``, ``N m``, ``V/(A*s)``. Angles count as a
dimension of their own, so that turns a second and oscillations a second are not confused. A scale is a fraction and a
power of pi: divided by an integer, a decimal number gives the same bits as the decimal number in SI (7 ms = 0.007 s).
"""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from fractions import Fraction

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_NUMBER = (0,) * len(BASE)


@dataclass(frozen=True)
class Unit:
    """What one of a unit is in coherent units of SI: scale * pi^turns, with the exponents of BASE."""

    scale: Fraction
    dimension: tuple[int | Fraction, ...]
    turns: int | Fraction = 0

    def times(self, other: Unit, power: int | Fraction = 1) -> Unit:
        """This times a power of another."""
        dimension = tuple(a + power * b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(self.scale * Fraction(other.scale**power), dimension, self.turns + power * other.turns)


@dataclass(frozen=True)
class Scale:
    """SI = value * factor / divisor + offset."""

    factor: float = 1.0
    divisor: float = 1.0
    offset: float = 0.0


_ONE = Unit(Fraction(1), _NUMBER)
_BASE = {name: Unit(Fraction(1), tuple(int(name == one) for one in BASE)) for name in BASE}
# In coherent units, or in those before them; what follows the sign | takes the prefixes of SI too.
_DERIVED: dict[str, tuple[str, int | Fraction]] = {
    "|g": ("kg", Fraction(1, 1000)),
    "|N": ("kg*m/s^2", 1),
    "|J": ("N*m", 1),
    "|W": ("J/s", 1),
    "|V": ("W/A", 1),
    "|Pa": ("N/m^2", 1),
    "|Hz": ("1/s", 1),
    "|C": ("A*s", 1),
    "|ohm": ("V/A", 1),
    "|Ohm": ("V/A", 1),
    "|Nm": ("N*m", 1),
    "|F": ("C/V", 1),
    "|H": ("V*s/A", 1),
    "|Wb": ("V*s", 1),
    "|T": ("Wb/m^2", 1),
    "|S": ("A/V", 1),
    "|bar": ("Pa", 100_000),
    "|L": ("m^3", Fraction(1, 1000)),
    "min": ("s", 60),
    "h": ("s", 3600),
    "d": ("s", 86_400),
    "in": ("m", Fraction(254, 10_000)),
    "ft": ("m", Fraction(3048, 10_000)),
    "kgf": ("N", Fraction(980_665, 100_000)),
    "lbf": ("N", Fraction(44_482_216_152_605, 10**13)),
    "psi": ("lbf/in^2", 1),
    "%": ("", Fraction(1, 100)),
    "lb": ("kg", Fraction(45_359_237, 10**8)),
}
_PREFIXES = {"n": -9, "u": -6, "m": -3, "c": -2, "d": -1, "h": 2, "k": 3, "M": 6, "G": 9}
_GRAVITY = Unit(Fraction(980_665, 100_000), (0, 1, -2, 0, 0, 0, 0, 0))
# Other spellings, in lower case but where the case decides.
_SPELLINGS = {
    "µ": "u", "μ": "u", "Ω": "ohm", "\u2126": "ohm", "·": "*", "⋅": "*", "×": "*", "²": "^2", "³": "^3", "⁻¹": "^-1",
    "**": "^", "°C": "degC", "°": "deg", "′": "'", " per ": "/",
    "Deg C": "degC", "deg C": "degC", "Deg F": "degF", "deg F": "degF",
}  # fmt: skip
_WORDS = {
    "s": "sec secs second seconds sekunde sekunden seconde secondes",
    "ms": "msec msecs millisecond milliseconds millis",
    "us": "usec usecs microsecond microseconds micros",
    "ns": "nsec nanosecond nanoseconds",
    "min": "mins minute minutes",
    "h": "hr hrs hour hours",
    "d": "day days",
    "m": "meter meters metre metres",
    "mm": "millimeter millimeters millimetre millimetres",
    "cm": "centimeter centimeters centimetre centimetres",
    "in": "inch inches",
    "ft": "foot feet",
    "V": "v volt volts",
    "mV": "millivolt millivolts",
    "A": "a amp amps ampere amperes",
    "mA": "ma milliamp milliamps milliampere milliamperes",
    "N": "n newton newtons",
    "N*cm": "Ncm",
    "N*m": "newtonmeter newtonmeters newtonmetre newtonmetres",
    "W": "w watt watts",
    "K": "kelvin",
    "degC": "celsius centigrade deg_c",
    "ohm": "ohms",
    "Hz": "hz hertz",
    "Pa": "pa pascal pascals",
    "kg": "kilogram kilograms kgs",
    "rad": "rads radian radians",
    "deg": "degs degree degrees Grad",
    "rev": "revs revolution revolutions turn turns rot rotations",
    "rev/min": "rpm revs/min r/min u/min rot/min",
    "rev/s": "rps",
    "deg/s": "dps",
    "%": "percent pct",
    "": "1 - count counts dimensionless none unitless",
}
_SYMBOL_OF = {word: symbol for symbol, words in _WORDS.items() for word in words.split()}
_SIGNS = ("*", "/", " ", ".")
_NAME = re.compile(r"[A-Za-z_%]+|1(?!\d)")
_POWER = re.compile(r"\^([+-]?\d*\.\d+)|\^?([+-]?\d+)|\^\(([+-]?\d+/[1-9]\d*)\)")
# Of a signal in an SI unit, what a refusal proposes.
_USUAL = {
    "s": ("s", "ms", "us", "ns", "min", "h", "d"),
    "rad": ("rad", "mrad", "deg", "rev", "turn"),
    "rad/s": ("rad/s", "deg/s", "rpm", "rev/s"),
    "rad/s^2": ("rad/s^2", "deg/s^2", "rev/s^2"),
    "m": ("m", "cm", "mm", "um", "in"),
    "m/s": ("m/s", "mm/s", "km/h"),
    "m/s^2": ("m/s^2", "mm/s^2", "g"),
    "N*m": ("N*m", "mN*m", "N*cm"),
    "K": ("K", "degC"),
    "kg": ("kg", "g"),
    "": ("1", "%"),
}


def usual(si: str) -> tuple[str, ...]:
    """Units that a signal in this SI unit often has, that one first."""
    known = _USUAL.get(si)
    return known or ((si, f"m{si}", f"k{si}") if f"|{si}" in _DERIVED or si in _BASE else (si,))


_CELSIUS, _FAHRENHEIT = Scale(offset=273.15), Scale(5.0, 9.0, 459.67 * 5 / 9)
_TEMPERATURES = {"degC": _CELSIUS, "C": _CELSIUS, "degF": _FAHRENHEIT, "F": _FAHRENHEIT}  # C, F: no charge, capacitance


def scale_to(si: str, text: str) -> Scale | None:
    """Of a unit to a signal's SI unit; None where the text is no unit, or not of that dimension."""
    text = spelled(text)
    wanted = unit_of(si)
    if text == si:
        return Scale()
    if si == "s":
        text = text.lower() if unit_of(text) != wanted and len(text) < 3 else text  # MS, S
    if si == "rad/s" and text in ("1/min", "min^-1"):
        text = "rev/min"
    if wanted == _BASE["K"] and (temperature := _TEMPERATURES.get(text)):
        return temperature
    if wanted is None:
        return None
    if wanted.dimension == _GRAVITY.dimension and text in ("g", "G", "g0", "mg"):
        found: Unit | None = replaced_gravity(text)
    else:
        found = unit_of(text)
    if found is None or found.dimension != wanted.dimension:
        return None
    ratio = found.times(wanted, -1)
    return Scale(float(ratio.scale.numerator) * math.pi**ratio.turns, float(ratio.scale.denominator))


def replaced_gravity(text: str) -> Unit:
    """Of an acceleration in units of the standard gravity."""
    return Unit(_GRAVITY.scale / (1000 if text == "mg" else 1), _GRAVITY.dimension)


def is_unit(text: str) -> bool:
    """Whether a cell is a unit: `mm`, `[s]`, `(deg/s)`, `Volt`."""
    text = spelled(text)
    return text in ("degC", "degF", "g0") or unit_of(text) is not None


def spelled(text: str) -> str:
    """A unit in the symbols of this module, without brackets."""
    text = text.strip().strip("\"'").strip()
    while text[:1] + text[-1:] in ("()", "[]", "<>", "{}"):
        text = text[1:-1].strip()
    for other, symbol in _SPELLINGS.items():
        text = text.replace(other, symbol)
    if text in _DERIVED or f"|{text}" in _DERIVED or text in _BASE:
        return text
    return _SYMBOL_OF.get(text) or _SYMBOL_OF.get(text.lower(), text)


@functools.cache
def unit_of(text: str) -> Unit | None:
    """A product of powers, with brackets; None where it is none. A / divides by the next factor alone."""
    text = " ".join(re.sub(r"\s*([*/])\s*", r"\1", text).split())
    found = _product(text, 0) if text else (_ONE, 0)
    return found[0] if found is not None and found[1] == len(text) else None


def _product(text: str, at: int) -> tuple[Unit, int] | None:
    """From a place in a text on; with the place behind it."""
    left = _factor(text, at)
    while left is not None and text[left[1] : left[1] + 1] in _SIGNS:
        sign = text[left[1]]
        right = _factor(text, left[1] + 1)
        left = None if right is None else (left[0].times(right[0], -1 if sign == "/" else 1), right[1])
    return left


def _factor(text: str, at: int) -> tuple[Unit, int] | None:
    """Likewise: a symbol, 1 or a product in brackets, to a power."""
    name = _NAME.match(text, at)
    if name is not None:
        one, end = _symbol(name[0]), name.end()
    elif text[at : at + 1] == "(" and (inner := _product(text, at + 1)) is not None and text[inner[1] :][:1] == ")":
        one, end = inner[0], inner[1] + 1
    else:
        return None
    if one is None:
        return None
    power = _POWER.match(text, end)
    return (one, end) if power is None else (_ONE.times(one, Fraction(power[1] or power[2] or power[3])), power.end())


def _symbol(text: str) -> Unit | None:
    """A unit of one name, with its prefix."""
    if text == "1":
        return _ONE
    plain = _plain(text)
    if plain is not None:
        return plain
    other = _SYMBOL_OF.get(text) or _SYMBOL_OF.get(text.lower())
    if other is not None and other != text:
        return unit_of(other)
    prefix, rest = _PREFIXES.get(text[:1]), text[1:]
    if prefix is None or not (rest in ("m", "s", "A", "K", "rad") or f"|{rest}" in _DERIVED):
        return None
    one = _plain(rest)
    return None if one is None else one.times(Unit(Fraction(10) ** prefix, _NUMBER))


def _plain(text: str) -> Unit | None:
    if text in _BASE:
        return _BASE[text]
    if text in ("deg", "rev"):
        return Unit(Fraction(1, 180) if text == "deg" else Fraction(2), _BASE["rad"].dimension, 1)
    of = _DERIVED.get(f"|{text}") or _DERIVED.get(text)
    if of is None:
        return None
    one = unit_of(of[0])
    assert one is not None
    return Unit(one.scale * of[1], one.dimension, one.turns)
