"""Time of day as text: ISO 8601 and what loggers write instead; seconds from the first row, to the nanosecond."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import date

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError

FloatArray = npt.NDArray[np.float64]

_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_DATE = r"""(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2}) | (?P<y8>\d{4})(?P<mo8>\d\d)(?P<d8>\d\d)
    | (?P<a>\d{1,2})(?P<mark>[-/.])(?P<b>\d{1,2})[-/.](?P<ye>\d{4}|\d\d)
    | (?P<since>\d+)\ days?,? | (?P<dn>\d{1,2})[- ](?P<name>[A-Za-z]{3})[A-Za-z]*[- ](?P<yn>\d{4})"""
_TIME = re.compile(
    rf"""(?P<day>(?:{_DATE})(?:[T_,;\ ]\s*|\ +))?
    (?P<clock>(?P<h>\d{{1,2}}):(?P<m>\d\d))
    (?: :(?P<s>\d\d)(?:[.,:](?P<f>\d+))? | [.,](?P<shifted>\d+))?
    (?P<rest>\s*(?:(?P<half>[AaPp])\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?)?)""",
    re.X | re.ASCII,
)
_DAY_S, _HOUR_S, _MINUTE_S = 86_400, 3600, 60


def is_time(cell: str) -> bool:
    """Whether a cell is a time of day, with a date or without."""
    return ":" in cell and _TIME.fullmatch(cell) is not None


class TimesOfDay:
    """A column of times as text; what was read before decides what is read later, so there is one of each column.

    A run without dates may pass midnight. Dates such as 5/2/2024 are read with the day first unless `month_first`:
    while all rows are of one day, that does not matter.
    """

    def __init__(self, month_first: bool = False) -> None:
        self._month_first = month_first
        self._days: set[str] = set()
        self._orders: set[bool] = set()  # what dates allow one reading alone, such as 5/13/2024: month first or not
        self._first: int | None = None  # [ns]
        self._minutes: dict[tuple[str | None, str, str], int | None] = {}  # [ns]
        self._known: dict[tuple[str, str], int] = {}  # [ns], by the text before the seconds and behind them
        self._form, self._scale = (-1, 0, 0, ""), 1
        self._either = ""  # a date that allows both
        self._period = 0  # [s], after which it starts over; 0: there are dates

    def seconds(self, cells: Sequence[str]) -> FloatArray:
        """Since the first time that was read; NaN where a cell is none."""
        out = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            at = self._alike(cell)
            if at is None:
                match = _TIME.fullmatch(cell)
                at = None if match is None else self._nanoseconds(match)
                if match is None or at is None:
                    continue
                self._remember(match)
            if self._first is None:
                self._first = at
            out[k] = (at - self._first) / 1e9
        return out

    def _remember(self, match: re.Match[str]) -> None:
        """Where the seconds are in a time, for others of the same length."""
        if match["s"] is None or match["f"] is None:
            return
        start, end = match.start("s"), match.end("f")
        scale = 10 ** (9 - (end - start - 3)) if end - start - 3 <= 9 else 0
        self._form = (len(match[0]), start, end, match[0][start + 2]) if scale else self._form
        self._scale = scale or self._scale

    def _alike(self, cell: str) -> int | None:
        """Of a time that differs in its seconds alone from one that was read [ns]; None of any other."""
        length, start, end, mark = self._form
        if len(cell) != length or cell[start + 2] != mark:
            return None
        key = (cell[:start], cell[end:])
        minute = self._known.get(key)
        if minute is None:
            match = _TIME.fullmatch(cell)
            if match is None or match.span("s")[0] != start or match.end("f") != end:
                return None
            self._nanoseconds(match)
            minute = self._minutes[(match["day"], match["clock"], match["rest"])]
            if minute is None:
                return None
            self._known[key] = minute
        digits = cell[start : start + 2] + cell[start + 3 : end]
        return minute + int(digits) * self._scale if digits.isascii() and digits.isdigit() else None

    @property
    def are_month_first(self) -> bool:
        """Whether all was read with the day first, and a date shows that the month is."""
        return self._orders == {True} and not self._month_first and self._either != ""

    def unwrapped(self, t: FloatArray) -> FloatArray:
        """All times [n], when all are read: those past midnight are of the next day.

        Raises PvidError when the dates can be read in two ways.
        """
        if self._either and len(self._days) > 1 and len(self._orders) != 1:
            raise PvidError(f"dates such as {self._either} can be read in two ways, and the run lasts over midnight")
        if not self._period or t.size < 2:
            return t
        steps = np.diff(t)
        turns = np.cumsum(np.where(steps < -self._period / 2, self._period, 0))
        if not turns[-1]:
            return t
        fine = np.round(t * 1e9).astype(np.int64)  # exact up to some months
        fine[1:] += turns.astype(np.int64) * 10**9
        return fine / 1e9

    def _nanoseconds(self, match: re.Match[str]) -> int | None:
        key = (match["day"], match["clock"], match["rest"])
        if key not in self._minutes:
            self._minutes[key] = self._of_minute(match)
        minute = self._minutes[key]
        if minute is None:
            return None
        if match["shifted"] is not None:  # mm:ss.f, as spreadsheets show it
            minute //= _MINUTE_S
            self._period = _HOUR_S
        return minute + int(match["s"] or 0) * 10**9 + int(((match["f"] or match["shifted"] or "") + "0" * 9)[:9])

    def _of_minute(self, match: re.Match[str]) -> int | None:
        """Of the date, hour, minute and zone [ns]."""
        hour, minute = int(match["h"]), int(match["m"])
        if match["half"]:
            hour = hour % 12 + (12 if match["half"] in "Pp" else 0)
        day = 0
        if match["day"]:
            found = self._day(match)
            if found is None:
                return None
            day = found
        else:
            self._period = _DAY_S
        seconds = day * _DAY_S + hour * _HOUR_S + minute * _MINUTE_S
        zone = match["zone"] or ""
        if zone[:1] in "+-" and zone:
            digits = zone[1:].replace(":", "") + "00"
            offset = int(digits[:2]) * _HOUR_S + int(digits[2:4]) * _MINUTE_S
            seconds -= offset if zone[0] == "+" else -offset
        return seconds * 10**9

    def _day(self, match: re.Match[str]) -> int | None:
        """Number of a date; None of an impossible one."""
        self._days.add(match["day"].strip())
        if match["since"]:
            return int(match["since"])
        if match["a"]:
            first, second, year = int(match["a"]), int(match["b"]), int(match["ye"])
            month_first = second > 12 or (self._month_first and first <= 12)
            if match["mark"] != "." and first != second:
                if first <= 12 and second <= 12:
                    self._either = match["day"].strip()
                else:
                    self._orders.add(second > 12)
            month, day = (first, second) if month_first else (second, first)
        elif match["name"]:
            name = match["name"].lower()
            year, day = int(match["yn"]), int(match["dn"])
            month = _MONTHS.index(name) + 1 if name in _MONTHS else 0
        else:
            year, month, day = (int(match[one] or match[f"{one}8"]) for one in ("y", "mo", "d"))
        try:
            return date(year if year > 99 else 2000 + year, month, day).toordinal()
        except ValueError:
            return None


def seconds_of(stamps: npt.NDArray[np.datetime64] | npt.NDArray[np.timedelta64]) -> FloatArray:
    """Of dates or durations of numpy, shape (n,): from the first on; NaN where there is none."""
    unit = np.datetime_data(stamps.dtype)[0]
    if unit == "generic":
        return np.full(stamps.shape, np.nan)
    there = ~np.isnat(stamps)
    out = np.full(stamps.shape, math.nan)
    if there.any():
        since = stamps[there] - stamps[there][0]
        fine = since.astype("timedelta64[ns]").astype(np.int64)
        out[there] = fine / 1e9
    return out
