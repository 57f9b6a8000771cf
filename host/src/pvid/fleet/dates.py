"""When a recording began: its own clock, a date in its name, or the time of its file."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

_HEAD = 8192  # bytes in which a text says it
_EPOCHS = (1e9, 4e9)  # seconds since 1970 of a clock: the years 2001 to 2096
_DATED = re.compile(
    r"(?<!\d)(20\d\d)([-_./]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])(?!\d)"
    r"(?:[T _-]+([01]\d|2[0-3])[:h_-]?([0-5]\d)(?:[:m_-]?([0-5]\d))?)?"
)
_NUMBERED = re.compile(r"(.*[^\W\d_].*?)[\W_]+\d+$")
_CLOCK = re.compile(r"(?:^|[\n,;\t])\"?(\d{10})(\d{3}|\d{6}|\d{9})?(?:\.\d*)?\"?(?=[,;\t])")


def began_of(path: Path) -> tuple[float, str]:
    """Seconds since 1970, and what says so: "recording", "name" or "file".

    A text says it in its first 8192 bytes: a date with a time of day (taken as UTC), or a clock that counts since 1970.

    Raises OSError when it cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if b"\0" not in head:
        text = head.decode("latin-1")
        dated = next((one for one in _DATED.finditer(text) if one[5]), None)
        if dated is not None and (found := _seconds(dated)) is not None:
            return found, "recording"
        clock = _CLOCK.search(text)
        if clock is not None and _EPOCHS[0] <= float(clock[1]) < _EPOCHS[1]:
            return float(clock[1]), "recording"
    for name in (path.name, path.parent.name):
        if (dated := _DATED.search(name)) is not None and (found := _seconds(dated)) is not None:
            return found, "name"
    return path.stat().st_mtime, "file"


def named_without_date(path: Path) -> str:
    """The board in the name of a file: `board3_2026-09-01.csv` and `board3-017.csv` are of board3; "": it has none."""
    stem = path.name.removesuffix(path.suffix)
    bare = _DATED.sub("", stem)
    numbered = _NUMBERED.fullmatch(stem) if bare == stem else None
    name = (bare if bare != stem else numbered[1] if numbered else "").strip(" _-.")
    return name if re.search(r"[^\W\d_]", name) else ""


def _seconds(dated: re.Match[str]) -> float | None:
    """Of a date; None of one that is not in the calendar."""
    year, _, month, day, hour, minute, second = dated.groups()
    try:
        at = datetime(int(year), int(month), int(day), int(hour or 0), int(minute or 0), int(second or 0), tzinfo=UTC)
        return at.timestamp()
    except ValueError:
        return None
