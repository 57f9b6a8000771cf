"""What one recording of a fleet gives: its identification, the verification of a log, or why there is none."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pvid.api.identify import identify_typed
from pvid.api.result import Result
from pvid.base.errors import PvidError
from pvid.base.version import __version__
from pvid.base.wording import reason
from pvid.board.mechanism_board import board_of
from pvid.fleet.dates import began_of
from pvid.log.file import Segment
from pvid.log.reader import LogReader
from pvid.log.rig import LOG_SUFFIX, hello_of_log, settings_text_of_log
from pvid.log.verify import Verdict, Verifier

_PIECE = 1 << 20
_NS = 1e-9
EQUAL = "equal"


@dataclass(frozen=True)
class Question:
    """What is asked of every recording; as in `pvid.identify`.

    Attributes
    ----------
    verify : whether a log is computed again with the twin, bit for bit
    own, shared : of recordings that are identified together
    reports : folder of the reports; None: none are written. They are no part of the key
    """

    model: str | None = None
    rig: str | None = None
    columns: str | None = None
    core: Literal["f32", "q31", "f64"] | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    verify: bool = True
    own: tuple[str, ...] = ()
    shared: tuple[str, ...] = ()
    reports: str | None = field(default=None, repr=False)

    def key(self, *paths: Path) -> str:
        """Sixteen digits that change with the content of the recordings, the rig files beside them, the question or the
        version.

        Raises OSError when it cannot be read.
        """
        digest = hashlib.sha256(repr((__version__, self, *(path.name for path in paths))).encode())
        others = [Path(one) for one in (self.model, self.rig) if one is not None]
        for one in (*(file for path in paths for file in (path, path.with_suffix(".toml"))), *others):
            digest.update(b"\0")
            if one.is_file():
                with one.open("rb") as file:
                    while piece := file.read(_PIECE):
                        digest.update(piece)
        return digest.hexdigest()[:16]


@dataclass(frozen=True)
class Row:
    """A recording's.

    Attributes
    ----------
    key : of its content and the question
    path : as it was given; of recordings that are identified together their folder
    board : USB serial number of the board that sent a log, else its name and folder; of a run its folder, until
        `pvid.fleet.dates.boards_of` sees them all
    began : seconds since 1970
    dated : what says so: "log", "recording", "name" or, of a run without a date, "file"
    samples : that were identified
    identified, verdict, status, warning : as in pvid.Result, the warning a line each; None: it was refused
    verified : of a log: EQUAL, or the first difference, or why it was not; None: not asked, or no log
    failure : why there is no result; None: there is one
    parameters : name -> (value, standard error, unit); empty where nothing was identified
    took : seconds of work
    predicted : R^2 of the worst predicted sensor, of motion that was not fitted; None: it was not looked at
    se_apart : name -> standard error without the part of scale, which recordings of one rig have in common
    se_noise : name -> standard error by noise alone
    report : its report; None: none was asked for
    """

    key: str
    path: str
    board: str
    began: float
    samples: int | None = None
    identified: bool | None = None
    verdict: str | None = None
    status: str | None = None
    warning: str | None = None
    verified: str | None = None
    failure: str | None = None
    parameters: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    took: float = 0.0
    predicted: float | None = None
    se_apart: Mapping[str, float] = field(default_factory=dict)
    report: str | None = None
    se_noise: Mapping[str, float] = field(default_factory=dict)
    dated: str = "file"


def row_of(given: str | tuple[str, ...], question: Question) -> Row:
    """Identifies a recording, or several of one folder together, and verifies logs; whatever they contain, there is a
    row."""
    start = time.monotonic()
    places = [Path(given)] if isinstance(given, str) else [Path(one) for one in given]
    place = places[0]
    path = given if isinstance(given, str) else str(place.parent)
    key = ""
    try:
        key = question.key(*places)
        board, began, dated = _origin(place)
        board = board if isinstance(given, str) or place.suffix == LOG_SUFFIX else path
    except (OSError, PvidError) as error:
        return Row(key, path, str(place.parent), 0.0, failure=_told(error), took=time.monotonic() - start)
    try:
        several = len(places) > 1
        result = identify_typed(
            places if several else place,
            question.model,
            question.rig,
            question.columns,
            question.core,
            None,
            question.settings,
            question.own if several else (),
            question.shared if several else (),
        )
        report = None if question.reports is None else _reported(result, question.reports, Path(path), key)
    except (PvidError, OSError) as error:
        return Row(key, path, board, began, dated=dated, failure=_told(error), took=time.monotonic() - start)
    return Row(
        key,
        path,
        board,
        began,
        result.details.get("samples", result.details.get("ticks")),
        result.identified,
        result.verdict,
        result.status,
        _a_line_each(result.details["warning"], result.details.get("reasons", {})),
        _all_verified(places, question) if question.verify else None,
        parameters={name: (one.value, one.se, one.unit) for name, one in result.parameters.items()},
        took=time.monotonic() - start,
        predicted=min((one["r2"] for one in result.details.get("prediction", {}).values()), default=None),
        se_apart={name: result.se_apart(name) for name in result.parameters},
        se_noise={name: se for name in result.parameters if (se := result.details["parameters"][name].get("se_noise"))},
        report=report,
        dated=dated,
    )


def _a_line_each(warning: str | None, reasons: Mapping[str, str]) -> str | None:
    """A warning with its sentences in lines."""
    alarms = [one for one in reasons.values() if warning and one in warning]
    return "\n".join(alarms) if alarms and " ".join(alarms) == warning else warning


def _reported(result: Result, folder: str, path: Path, key: str) -> str:
    """Writes the report of a recording, under its name and a part of its key."""
    return str(result.report(Path(folder) / f"{path.stem}-{key[:8]}.html"))


def _told(error: OSError | PvidError) -> str:
    return reason(error) if isinstance(error, OSError) else str(error)


def _origin(path: Path) -> tuple[str, float, str]:
    """The board, when it began, and what says so."""
    if path.suffix != LOG_SUFFIX:
        return str(path.parent), *began_of(path)
    began, dated, serial = path.stat().st_mtime, "file", ""
    for record in LogReader(path):
        if isinstance(record.item, Segment):
            usb = record.item.description.get("usb")
            serial = str(usb.get("serial") or "") if isinstance(usb, dict) else ""
            began, dated = record.item.unix_ns * _NS, "log"
            break
    hello = None if serial else hello_of_log(path)
    return serial or (str(path.parent) if hello is None else f"{hello.board} in {path.parent}"), began, dated


def _all_verified(paths: Sequence[Path], question: Question) -> str | None:
    """Of all logs among them: EQUAL, or what is not of the first one that is not; None: there is no log."""
    found = [_verified(one, question.model) for one in paths if one.suffix == LOG_SUFFIX]
    return next((one for one in found if one != EQUAL), EQUAL) if found else None


def _verified(path: Path, model: str | None) -> str:
    """EQUAL, or what is not. `model`: of the question."""
    verdict, first = Verdict(), ""
    try:
        text = settings_text_of_log(path)
        board = None if text is None else board_of(text, model)
        for stretch in Verifier(board).stretches(LogReader(path)):
            verdict.add(stretch)
            if not first and (stretch.difference is not None or stretch.why_not is not None):
                first = stretch.text
    except PvidError as error:
        return f"not verified: {error}"
    return EQUAL if not first and verdict.verified and not verdict.left else first or verdict.text
