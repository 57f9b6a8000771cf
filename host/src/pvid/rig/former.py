"""The rig file of a former version as one of today: its keys are translated, at the door.

A mechanism that had keys of its own has them in pvid/models/NAME/former.py.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.toml_text import copied, put
from pvid.base.wording import shown
from pvid.models.registry import names


def mechanism_of_former(document: Mapping[str, Any]) -> str | None:
    """The mechanism whose former keys a file has; None: it has none."""
    for name in names():
        former = _former_of(name)
        if former is not None and any(_get(document, key) is not None for key in (*former.MOVED, *former.RELATIVE)):
            return name
    return None


def names_of_former_board() -> str:
    """What the boards of version 0.1, which all were of one mechanism and named nothing, would say about it."""
    return next(str(former.NAMES_OF_BOARD) for name in names() if (former := _former_of(name)) is not None)


def translated(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The tables of a file with the keys of today; `name`: of its mechanism.

    Raises PvidError naming a key that has no place any more, with what to do.
    """
    out: dict[str, Any] = copied(document)
    former = _former_of(name)
    if former is None:
        return out
    for key, place in former.MOVED.items():
        value = _taken(out, key)
        if value is not None and not (place.endswith((".reach", ".resolution")) and value == 0):
            put(out, place, value)
    for key, (place, whole) in former.RELATIVE.items():
        share, of = _taken(out, key), _get(out, whole)
        if share is not None:
            if not isinstance(share, int | float) or not isinstance(of, int | float):
                raise PvidError(f"{key} must be a number, relative to {whole}")
            put(out, place, share * of)
    for key, usual in former.BY_OPTION.items():
        value = _taken(out, f"identifier.{key}")
        if value is not None and usual is not None and value != usual:
            raise PvidError(f"identifier.{key} is an option of the command: leave it out, and type --{key} {value}")
    for key, usual in former.OF_THE_STRONG_FORM.items():
        value = _taken(out, key)
        if value is not None and value != usual:
            raise PvidError(f"{key} = {shown(str(value))} is of the strong form, which chooses it: leave it out")
    for key in (*former.CHOSEN, "zero"):
        _taken(out, f"identifier.{key}")
    return {key: value for key, value in out.items() if value != {}}


def _former_of(name: str) -> Any:
    module = f"pvid.models.{name}.former"
    return importlib.import_module(module) if name in names() and find_spec(module) is not None else None


def _get(document: Mapping[str, Any], key: str) -> Any:
    *tables, name = key.split(".")
    place: Any = document
    for table in tables:
        place = place.get(table) if isinstance(place, Mapping) else None
    return place.get(name) if isinstance(place, Mapping) else None


def _taken(document: dict[str, Any], key: str) -> Any:
    """The value of a key, which goes; None where it is not there."""
    value, (*tables, name) = _get(document, key), key.split(".")
    if value is not None:
        place = document
        for table in tables:
            place = place[table]
        del place[name]
    return value
