"""TOML from strangers: rig files, populations, settings."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.wording import shown

# Longer ones are slips. A key of many parts takes tomllib time and memory that grow with their square: half a minute
# and 4 GB for 60 kB.
MOST_BYTES = 64_000
TOO_LONG = f"is no TOML for pvid: it is longer than {MOST_BYTES // 1000} kB"
_LONGEST_LINE = 4000
_MOST_PARTS = 4  # of a key, as sensor.phi.resolution


def key_and_value(setting: str, example: str) -> tuple[str, Any]:
    """`l1=0.25` as a key and its value, which is written as in TOML; the quotes of a word may be left out.

    Raises PvidError when it is none; the sentence contains the example.
    """
    key, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not key or not text:
        raise PvidError(f"--set {shown(setting)} is not KEY=VALUE, as in --set {example}")
    if key.count(".") >= _MOST_PARTS:
        raise PvidError(f"--set {shown(setting)} has too many parts: it is KEY=VALUE, as in --set {example}")
    try:
        return key, toml_document(f"value = {text}")["value"]
    except PvidError:
        return key, text


class NotATableError(PvidError):
    """A dotted key goes through something that is no table, whose name is `table`."""

    def __init__(self, table: str, value: Any) -> None:
        super().__init__(f"{table} must be a table, [{table}], not {shown(str(value))}")
        self.table = table


def copied(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables that can be changed without the given ones."""
    return {key: copied(value) if isinstance(value, Mapping) else value for key, value in tables.items()}


def put(tables: dict[str, Any], key: str, value: Any) -> None:
    """Sets a dotted key, as sensor.phi.resolution, in tables that are made where they are missing.

    Raises NotATableError where one of them is none.
    """
    *parts, name = key.split(".")
    place = tables
    for part in parts:
        place = place.setdefault(part, {})
        if not isinstance(place, dict):
            raise NotATableError(part, place)
    place[name] = value


def quoted(text: str) -> str:
    """A string of TOML: that of JSON, whose escapes are TOML's as well; what is no UTF-8 becomes question marks."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_document(text: str) -> dict[str, Any]:
    """The tables in a text.

    Raises PvidError when it is not TOML, or too long or too deep for a file that a person wrote.
    """
    if len(text) > MOST_BYTES:
        raise PvidError(TOO_LONG)
    if max(map(len, text.split("\n"))) > _LONGEST_LINE:
        raise PvidError(f"is no TOML for pvid: it has a line of more than {_LONGEST_LINE} characters")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PvidError(f"is not TOML: {error}") from error
    except RecursionError as error:
        raise PvidError("cannot be read as TOML: its tables are nested too deeply") from error
