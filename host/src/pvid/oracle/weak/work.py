"""Work that an identification may do: where nothing fits, it ends.

A search that arrives takes few passes; one whose equations do not describe the run wanders from design to design. Work
is counted, not timed, so that an answer depends on no computer: a unit is about a millisecond of a usual one. Those who
search share what is left, and stop where it is spent; a fit then makes some passes yet.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

# Of a search in the designs that are usually chosen, and of a long recording, which shows earlier where it leads: one
# that fits takes a tenth to a half of them.
_PASSES, _PASSES_OF_LONG = 360, 180
_OF_A_PASS, _OF_A_STEP = 2.0, 0.15
_OF_ROWS, _OF_REVERSALS = 1.5e-7, 3.5e-6  # of a product of a column's entries: of all windows, of located reversals
_FUNCTIONS = 40
_SAMPLES_OF_A_WINDOW, _SAMPLES_OF_A_REVERSAL = 150, 25  # more reversals are those of a sensor that chatters


@dataclass
class Work:
    """Attributes
    ----------
    whole, left : units; those that are left fall below 0
    """

    whole: float
    left: float

    @property
    def is_spent(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0


_unlimited = Work(float("inf"), float("inf"))
_current: ContextVar[Work] = ContextVar("work", default=_unlimited)


def allowance(kinds: int, columns: int, reversals: int, samples: int) -> float:
    """Of a run's analysis.

    Parameters
    ----------
    kinds, columns : of its rows
    reversals : of its signs
    """
    entries = 2 * min(reversals, samples / _SAMPLES_OF_A_REVERSAL)
    whole = of_pass(samples / _SAMPLES_OF_A_WINDOW, kinds * _FUNCTIONS, columns, entries)
    return _PASSES * _OF_A_PASS + _PASSES_OF_LONG * (whole - _OF_A_PASS)


def of_pass(windows: float, rows: int, columns: int, entries: float) -> float:
    """Of whitening once the columns of all windows, in which reversals have so many entries."""
    turned = entries * rows * (rows + 2 * columns)
    return _OF_A_PASS + _OF_ROWS * windows * columns * rows**2 + _OF_REVERSALS * turned


@contextmanager
def limited(units: float) -> Iterator[Work]:
    """What runs inside shares so many units, or those that are left outside if these are fewer."""
    outer = _current.get()
    inner = Work(units, min(units, outer.left))
    begun = inner.left
    token = _current.set(inner)
    try:
        yield inner
    finally:
        _current.reset(token)
        outer.left -= begun - inner.left


def spend(units: float) -> None:
    """Counts what has been done."""
    _current.get().left -= units


def spend_step() -> None:
    """Counts a step of Gauss and Newton."""
    _current.get().left -= _OF_A_STEP


def is_spent() -> bool:
    """Whether a search is to stop."""
    return _current.get().is_spent


def left() -> float:
    """Units."""
    return _current.get().left
