"""The words in which an answer and each of its parameters are judged. A person reads the same word everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

Word = Literal["good", "usable", "not_explained", "not_identified"]

_ORDER: tuple[Word, ...] = get_args(Word)

# A standard error beyond this part of a value makes the value usable and not good.
WIDE = 0.1


def worst(words: Iterable[Word]) -> Word:
    """Of several; good where there are none."""
    return max(words, key=_ORDER.index, default="good")
