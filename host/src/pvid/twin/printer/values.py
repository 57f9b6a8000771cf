"""Objects of a printed module from the settings that fill the structs of C, and records of it."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

from pvid.twin.printer.machine import Array, Pointer, f32

# Fields that the identifier sets, and a field with another name in Python, as in pvid.core.headers.
_LATER = ("angle", "model", "update_rate_hz", "refine")
_NAMES: Mapping[str, str] = {"sample_rate_hz": "sample_rate"}


def filled(module: ModuleType, kind: str, settings: Any) -> Any:
    """A struct of a printed module with the settings' attributes of its fields' names, as Headers.filled in C."""
    one = getattr(module, kind)()
    for name, field in type(one).__fields__.items():
        if name in _LATER:
            continue
        value = getattr(settings, _NAMES.get(name, name.rstrip("_")))
        if isinstance(field, Pointer):
            setattr(one, name, _pointed(module, field, value))
        elif isinstance(field, Array):
            entries = numbers(np.asarray(value), field.entry)
            getattr(one, name)[: len(entries)] = entries
        elif isinstance(field, type):
            if isinstance(value, tuple):
                setattr(one, name, field(*value))
            else:
                setattr(one, name, filled(module, field.__name__, value))
        else:
            setattr(one, name, number(value, field))
    return one


def _pointed(module: ModuleType, field: Pointer, value: Any) -> Any:
    if value is None:
        return None
    if not hasattr(module, field.to):
        return numbers(np.asarray(value), f32(0) if field.to == "float" else 0)
    if isinstance(value, tuple):
        return [filled(module, field.to, one) for one in value]
    one = filled(module, field.to, value)
    return [one] if field.many else one


def number(value: Any, like: Any) -> Any:
    """A number as printed code has it: float32, an integer of Python or a bool."""
    return f32(value) if isinstance(like, np.floating) else bool(value) if isinstance(like, bool) else int(value)


def numbers(values: Any, like: Any) -> list[Any]:
    """All entries of an array, one after the other."""
    flat = np.ravel(values)
    return list(np.asarray(flat, f32)) if isinstance(like, np.floating) else [int(one) for one in flat]
