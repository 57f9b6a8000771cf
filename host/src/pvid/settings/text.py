"""The settings of an identifier in the text of a log: numbers as Python writes them, which read back exactly; long
tables as their bits."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.refine import RefineSignal
from pvid.settings.weak import WeakFilter, WeakNoise

TABLE = "engine"  # of the text: the name in all logs that there are
_SHORT, _WORDS = 16, 12  # numbers that are written as such; words in a line


def written(value: Any) -> str:
    """A setting in the text of a log."""
    match value:
        case bool():
            return str(value).lower()
        case IntEnum():
            return str(int(value))
        case WeakFilter():
            return written(value.weights)
        case RefineSignal():
            return written([value.sample, value.order, value.scale, value.range, int(value.source)])
        case np.ndarray() if value.size > _SHORT:  # the bits
            words = [f"{word:08x}" for word in value.view(np.uint32).tolist()]
            rows = [" ".join(words[k : k + _WORDS]) for k in range(0, len(words), _WORDS)]
            return "\n".join(["'''", *rows, "'''"])
        case WeakNoise():
            return written([value.kind, value.power, value.a, value.b, float(value.factor)])
        case np.ndarray():
            return written(value.tolist())
        case tuple() | list():
            apart = ",\n" if len(value) > _SHORT else ", "
            return f"[{apart.join(map(written, value))}]"
        case _:
            return repr(value)


def array_of(value: Any, kind: type[np.generic] = np.float32) -> npt.NDArray[Any]:
    """Numbers, or the bits of a long table."""
    if isinstance(value, str):
        return np.array([int(word, 16) for word in value.split()], np.uint32).view(np.float32)
    return np.array(value, kind)


def part_of(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The keys of a part without its name."""
    return {key.removeprefix(f"{name}_"): value for key, value in settings.items() if key.startswith(f"{name}_")}
