"""What cannot be compiled, and where the user wrote it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from pvid.base.errors import PvidError

_HERE = str(Path(__file__).parent)


@dataclass(frozen=True)
class Place:
    """A line of a model file; line 0: not known."""

    path: str = ""
    line: int = 0

    def __str__(self) -> str:
        return f"{Path(self.path).name}, line {self.line}: " if self.line else ""


def place_of_caller() -> Place:
    """The line outside this package from which the innermost call came."""
    frame = sys._getframe(1)
    while frame.f_back is not None and str(Path(frame.f_code.co_filename).parent) == _HERE:
        frame = frame.f_back
    return Place(frame.f_code.co_filename, frame.f_lineno)


class ModelError(PvidError):
    """A description that cannot be compiled.

    Attributes
    ----------
    cause : in one sentence, without the place
    place : of the line of the model file that the cause is in
    """

    def __init__(self, cause: str, place: Place = Place()) -> None:  # noqa: B008
        super().__init__(f"{place}{cause}")
        self.cause, self.place = cause, place

    def at(self, place: Place) -> ModelError:
        """The same with a place, where it has none."""
        return self if self.place.line else ModelError(self.cause, place)
