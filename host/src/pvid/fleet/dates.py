"""When a recording began: its own clock, a date in its name, or the time of its file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

_HEAD = 8192  # bytes in which a text says it
_EPOCHS = (1e9, 4e9)  # seconds since 1970 of a clock: the years 2001 to 2096
_DATED = re.compile(
    r"(?<!\d)(20\d\d)([-_./]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])(?!\d)"
    r"(?:[T _-]+([01]\d|2[0-3])[:h_-]?([0-5]\d)(?:[:m_-]?([0-5]\d))?)?"
)
# Of a name: a date in either order with all behind it that counts: a time, its fraction, a counter, a copy.
_COUNTED = r"(?:[\W_]*(?:copy|kopie|\d+)(?![^\W_]))*\)?"
_IN_NAME = re.compile(rf"{_DATED.pattern}(?:Z|s|UTC)?{_COUNTED}")
_DAY_FIRST = re.compile(rf"(?<![^\W_])[0-3]?\d([._-])[01]?\d\1(?:20\d\d){_COUNTED}")
_COPY = re.compile(r"[\W_]+(?:\(\d+\)|copy|kopie)$", re.I)
_NUMBERED = re.compile(r"(.*[^\W\d_].*?)[\W_]*?(\d+)")
_DATED_FOLDER = re.compile(r"20\d\d(?:[-_.]?\d\d){0,2}")
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


def boards_of(paths: Iterable[Path]) -> dict[Path, str]:
    """The board of each recording of a fleet: its folder, where there are several; else what the names of files share.

    A folder whose name is a date is the one above it. A name counts from two recordings of it on; without it: what
    precedes a number at its end, where this is padded with zeros or the name has a date. Else the folder is the board.
    """
    names = {path: _name(path) for path in paths}
    folders = {path: Path(*(one for one in path.parent.parts if not _DATED_FOLDER.fullmatch(one))) for path in names}
    if len(set(folders.values())) > 1:
        return {path: str(folder) for path, folder in folders.items()}
    often = Counter(name for name, _ in names.values() if name)
    stems = {name: one[1] for name in often if (one := _NUMBERED.fullmatch(name))}
    boards = {stems.get(name) for name, count in often.items() if count > 1}  # whose number is no recording's: motor_1
    own = {}
    for path, (name, dated) in names.items():
        numbered = _NUMBERED.fullmatch(name)
        if often[name] == 1 and numbered and numbered[1] not in boards and (dated or numbered[2].startswith("0")):
            name, dated = numbered[1], True
        own[path] = name if dated or often[name] > 1 else ""
    shared = any(count > 1 for name, count in Counter(own.values()).items() if name)
    return {path: str(folders[path] / own[path]) if shared else str(folders[path]) for path in names}


def _name(path: Path) -> tuple[str, bool]:
    """Of a file without what tells recordings of one board apart, "" without a letter; and whether it has a date."""
    stem = path.name.removesuffix("".join(path.suffixes[-2:])) if path.suffix == ".gz" else path.stem
    bare = (_IN_NAME if _IN_NAME.search(stem) else _DAY_FIRST).sub("", stem)
    name = _COPY.sub("", bare).strip(" _-.()")
    return (name if re.search(r"[^\W\d_]", name) else ""), bare != stem


def _seconds(dated: re.Match[str]) -> float | None:
    """Of a date; None of one that is not in the calendar."""
    year, _, month, day, hour, minute, second = dated.groups()
    try:
        at = datetime(int(year), int(month), int(day), int(hour or 0), int(minute or 0), int(second or 0), tzinfo=UTC)
        return at.timestamp()
    except ValueError:
        return None
