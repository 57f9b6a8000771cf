"""The rig of a log, and the run in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.base.wording import listed
from pvid.link.frames import Hello, Names
from pvid.link.names import BoardNames
from pvid.log.mechanism import UNNAMED, LogMechanism, mechanism_described, mechanism_named
from pvid.log.reader import LogReader, LogStream
from pvid.log.values import Values, is_rate
from pvid.models.registry import names as names_of_shipped
from pvid.models.registry import shipped
from pvid.rig.columns import Columns
from pvid.rig.former import mechanism_of_former
from pvid.rig.mechanism_file import parsed_file
from pvid.rig.run import MIN_ROWS, Recording
from pvid.settings.text import TABLE

LOG_SUFFIX = ".pvlog"
_LARGEST = 1e6  # [rad], [m]: no sensor of a rig reads more


def settings_text_of_log(path: Path) -> str | None:
    """The rig of a log with the settings of its identifier (board.mechanism_board); None: the log has none.

    Raises PvidError when the log cannot be read.
    """
    text = _text_of_log(path)
    return text if text is not None and is_settings_text(text) else None


def _text_of_log(path: Path) -> str | None:
    reader = LogReader(path)
    for _ in reader:
        if reader.rig is not None or reader.account.frames:  # it stands in front of all that the board said
            break
    return reader.rig


def is_settings_text(text: str) -> bool:
    """Whether the rig of a log has the settings of its identifier."""
    try:
        return isinstance(toml_document(text).get(TABLE), dict)
    except PvidError:
        return False


def document_of_log(path: Path) -> dict[str, Any] | None:
    """The tables of the rig in a log, without the identifier's; None: the log has none.

    Raises PvidError when the log cannot be read, or the rig file in it is none.
    """
    text = _text_of_log(path)
    if text is None:
        return None
    return {key: value for key, value in toml_document(text).items() if key != TABLE}


def mechanism_of_log(path: Path, rig_path: Path | None = None) -> LogMechanism:
    """The mechanism of a log: that of its rig, or of a rig file, with the constants in it, else the first one that the
    board named; UNNAMED if none did.

    Raises PvidError when the log or the rig file cannot be read, or is none.
    """
    text = _text_of_log(path)
    logged = {} if text is None else toml_document(text)
    document = logged if rig_path is None else parsed_file(rig_path, toml_document)
    if rig_path is not None:
        shipped(named_in(document) or "", str(rig_path))
    found = mechanism_in(document)
    if found is not None:
        return found
    for names in _names_of_log(path):
        with suppress(PvidError):
            return mechanism_named(names.text)
    return UNNAMED


def named_in(document: Mapping[str, Any]) -> str | None:
    """The mechanism that a rig file names, or whose former keys it has."""
    table = document.get("model", {})
    name = table.get("name") if isinstance(table, Mapping) else None
    return name if isinstance(name, str) else mechanism_of_former(document)


def mechanism_in(document: Mapping[str, Any]) -> LogMechanism | None:
    """The shipped mechanism of a rig file, of today or of a former version, with the constants in it; None: it names
    none, or a model file, which does not run."""
    name, known = named_in(document), document.get("known")
    if name not in names_of_shipped():
        return None
    from pvid.models.mechanisms import described  # loads SymPy

    return mechanism_described(name, described(name), {**(known if isinstance(known, Mapping) else {}), **document})


def _names_of_log(path: Path) -> Iterator[Names]:
    return (record.item for record in LogReader(path) if isinstance(record.item, Names))


def names_of_log(path: Path) -> BoardNames | None:
    """What the first board named that named what there can be; None when none did."""
    for names in _names_of_log(path):
        with suppress(PvidError):
            return BoardNames.parse(names.text)
    return None


def refuse_to_append(path: Path, rig: str | None) -> None:
    """A log has one rig file, `rig`: verify, identify and export take it for all of its segments.

    Raises PvidError when `path` is there and is no log, or one with another rig file.
    """
    stream = LogStream()
    try:
        with path.open("rb") as file:
            while stream.rig is None and not stream.account.frames and (data := file.read(1 << 16)):
                for _ in stream.feed(data):
                    pass
    except FileNotFoundError:
        return
    except OSError as error:
        raise PvidError(f"cannot read {path}: {error.strerror}") from error
    if stream.account.bytes and not stream.is_log and not stream.account.frames:
        raise PvidError(f"{path} is not a log of pvid: nothing is appended")
    if rig is not None and stream.rig is not None and stream.rig != rig:
        raise PvidError(f"{path} was recorded with another rig file: record to a new log")


def hello_of_log(path: Path) -> Hello | None:
    """Who the board is, by its first word on it; None when it never said."""
    for record in LogReader(path):
        if isinstance(record.item, Hello):
            return record.item
    return None


def source_of(path: Path) -> Path | Callable[[Columns], Recording]:
    """A file as pvid.identification.reading takes it: of a log what reads it."""
    return partial(_read, path) if path.suffix == LOG_SUFFIX else path


def _read(path: Path, columns: Columns) -> Recording:
    if columns.named:
        raise PvidError(f"{path} is a log with known columns: omit --columns")
    return recording_of_log(path, [one.name for one in columns.channels])


def recording_of_log(path: Path, names: Sequence[str]) -> Recording:
    """The longest stretch of a log of a described mechanism without a gap, of the signals of these names.

    Raises PvidError when the log cannot be read, the board's sample rate is unknown, it has other samples or too few.
    """
    mechanism = mechanism_of_log(path)
    named = [one.name for one in mechanism.samples]
    if lacking := [name for name in names if name not in named]:
        raise PvidError(f"{path} is a log of {mechanism.name}: it has {listed(named)}, and not {listed(lacking)}")
    (t, *signals), rate = _longest(path, mechanism, names)
    if (there := int(np.isfinite(signals).all(axis=0).sum())) < MIN_ROWS:
        raise PvidError(f"{path} holds {there} samples in a row; a recording needs at least {MIN_ROWS}")
    return Recording(t, dict(zip(names, signals, strict=True)), rate)


def _longest(path: Path, mechanism: LogMechanism, names: Sequence[str]) -> tuple[npt.NDArray[np.float64], float]:
    """t and these samples of the longest stretch without a gap [1 + names, ticks], NaN for what is no number or no
    rig's; and the sample rate."""
    hello = hello_of_log(path)
    if hello is None:
        raise PvidError(f"{path}: the log contains no description of the board, so its sample rate is unknown")
    if not is_rate(hello.sample_rate):
        raise PvidError(f"{path}: the board reported a sample rate of {hello.sample_rate:g} Hz, which is invalid")
    values = Values(mechanism, hello)
    best: list[npt.NDArray[np.float64]] = []
    parts: list[npt.NDArray[np.float64]] = []
    longest = length = 0
    expected = None
    for record in LogReader(path):
        for rows in values.rows(record):
            if rows.table != "samples":
                continue
            columns = np.stack([rows.columns[name] for name in ("t", *names)])
            columns[1:, ~(np.abs(columns[1:]) <= _LARGEST).all(axis=0)] = np.nan
            if record.tick != expected:
                parts, length = [], 0
            parts.append(columns)
            length += columns.shape[1]
            expected = record.tick + columns.shape[1]
            if length > longest:
                best, longest = parts, length
    return np.concatenate([np.empty((1 + len(names), 0)), *best], axis=1), float(hello.sample_rate)
