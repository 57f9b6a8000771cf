"""The state of a printed identifier, taken over from the compiled one at any tick."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvid.core.headers import Placed
from pvid.twin.printer.machine import Array, Pointer
from pvid.twin.printer.values import number, numbers

_Places = dict[tuple[int, str], Any]  # offset, name of a struct or "" of an array of numbers


def take_over(one: Any, placed: Placed) -> None:
    """Overwrites a printed struct with one of C.

    Of its pointers NULL becomes None, and one to a place in the struct itself points to that place; all others point to
    tables, which do not change.
    """
    record, address = placed
    places: _Places = {}
    pointers: list[tuple[Any, str, str, int]] = []
    _copy(one, record, 0, places, pointers)
    for owner, name, to, value in pointers:
        at = value - address
        if value == 0:
            setattr(owner, name, None)
        elif 0 <= at < record.nbytes:
            inside = places.get((at, to), places.get((at, "")))
            if inside is not None:  # else of a member of a union that is not in use
                setattr(owner, name, inside)


def _copy(one: Any, record: Any, offset: int, places: _Places, pointers: list[tuple[Any, str, str, int]]) -> None:
    places[offset, type(one).__name__] = one
    for name, field in type(one).__fields__.items():
        in_c = name.rstrip("_") if name not in record.dtype.fields else name
        value, at = record[in_c], offset + int(record.dtype.fields[in_c][1])
        if isinstance(field, Pointer):
            pointers.append((one, name, field.to, int(value)))
        elif isinstance(field, Array) and isinstance(field.entry, type):
            entries = np.ravel(value)
            for place, entry in enumerate(entries):
                _copy(getattr(one, name)[place], entry, at + place * entries.itemsize, places, pointers)
        elif isinstance(field, Array):
            places[at, ""] = getattr(one, name)
            getattr(one, name)[:] = numbers(value, field.entry)
        elif isinstance(field, type):
            _copy(getattr(one, name), value, at, places, pointers)
        else:
            setattr(one, name, number(value, field))
