"""Sizes of the core's arrays, the PVID_MAX_ macros of pvid/config.h."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from pvid.core.sources import FIRMWARE

_DEFINED = re.compile(r"^#define (PVID_MAX_\w+) (\d+)$", re.MULTILINE)
_LEAST = re.compile(r"^#if (PVID_MAX_\w+) < (\d+) ", re.MULTILINE)
_MOST = re.compile(r"^#if (PVID_MAX_\w+) < \d+ \|\| \1 > (\d+)$", re.MULTILINE)

# Sizes that depend on the design alone are rounded up to multiples of these.
_STEPS = {
    "PVID_MAX_RING": 512,
    "PVID_MAX_HARMONICS": 25,
    "PVID_MAX_FUNCTIONS": 40,
    "PVID_MAX_POWER": 8,
    "PVID_MAX_DECIMATION": 64,
}


@cache
def default_sizes() -> Mapping[str, int]:
    """Macro -> value where nothing else is given."""
    text = (FIRMWARE / "include" / "pvid" / "config.h").read_text(encoding="utf-8")
    return {name: int(value) for name, value in _DEFINED.findall(text)}


@cache
def least_sizes() -> Mapping[str, int]:
    """Macro -> least value that config.h allows."""
    text = (FIRMWARE / "include" / "pvid" / "config.h").read_text(encoding="utf-8")
    return {name: int(value) for name, value in _LEAST.findall(text)}


@cache
def most_sizes() -> Mapping[str, int]:
    """Macro -> largest value that config.h allows."""
    text = (FIRMWARE / "include" / "pvid" / "config.h").read_text(encoding="utf-8")
    return {name: int(value) for name, value in _MOST.findall(text)}


def smallest(needed: Mapping[str, int]) -> dict[str, int]:
    """The smallest sizes that hold what is needed."""
    return {name: max(value, least_sizes().get(name, value)) for name, value in needed.items()}


def raised(needed: Mapping[str, int]) -> dict[str, int]:
    """Those of the needed sizes that exceed the defaults."""
    usual = default_sizes()
    return {name: value for name, value in needed.items() if value > usual.get(name, 0)}


def roomy(needed: Mapping[str, int]) -> dict[str, int]:
    """For this computer, those that exceed the defaults: what is needed or more, of few kinds. Libraries and stream
    programs of several designs are then linked from the same objects, which take seconds to compile."""
    wanted = {**default_sizes(), **needed}
    steps = {macro: _STEPS.get(macro, 1) for macro in wanted}
    return raised({macro: steps[macro] * -(-size // steps[macro]) for macro, size in wanted.items()})


def options_of(sizes: Mapping[str, int]) -> list[str]:
    """The compiler's, by name: equal sizes are equal options."""
    return [f"-D{macro}={size}" for macro, size in sorted(sizes.items())]
