"""What was made of the last few of something that is compared, not hashed: a compiled model."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Generic, TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")


class Recent(Generic[Given, Made]):
    """A function that makes something once for equal arguments, as long as it is among the last few.

    Parameters
    ----------
    make : the function
    kept : how many results
    equal : of two arguments
    """

    def __init__(
        self, make: Callable[[Given], Made], kept: int = 16, equal: Callable[[Given, Given], bool] = operator.eq
    ) -> None:
        self._make, self._kept, self._equal = make, kept, equal
        self._found: list[tuple[Given, Made]] = []

    def __call__(self, given: Given) -> Made:
        pair = next((one for one in self._found if one[0] is given or self._equal(one[0], given)), None)
        if pair is None:
            pair = (given, self._make(given))
        self._found = [pair, *(one for one in self._found if one is not pair)][: self._kept]
        return pair[1]
