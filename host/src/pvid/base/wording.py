"""What a sentence quotes: text from a file, names, and the reason of an error."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable


def typed_name() -> str:
    """pvid as the caller typed it, for a shell: ./tools/pvid sets the variable."""
    return shlex.quote(os.environ.get("PVID_CALLED") or "pvid")


def shown(text: str, longest: int = 40) -> str:
    """``text`` quoted for a sentence, on one line and of bounded length."""
    return ascii(text if len(text) <= longest else text[: longest - 3] + "...")


def listed(names: Iterable[object], word: str = "and") -> str:
    """``a``, ``a and b``, ``a, b and c``; with another word in place of and."""
    *first, last = map(str, names)
    return f"{', '.join(first)} {word} {last}" if first else last


def reason(error: BaseException) -> str:
    """Message of an error, on one line and without its full stop."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split()).rstrip(".")


def printable(text: str) -> str:
    """``text`` on one line of a terminal: what would move the cursor, colour it or turn the text around is escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def in_utf8(text: str) -> str:
    """``text`` as a file in UTF-8 holds it: the bytes of a file's name that are no UTF-8 are escaped."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def with_unit(value: float, unit: str, digits: int) -> str:
    """``0.0046 rad``: a number of so many digits, with its unit where it has one."""
    return f"{in_digits(value, digits)} {unit}".rstrip()


def in_digits(value: float, digits: int) -> str:
    """A number rounded to so many digits, without an exponent from 0.0001 to 999999: ``120``."""
    return f"{float(f'{value:.{digits}g}'):.{max(digits, 6)}g}"
