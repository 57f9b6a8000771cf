"""What a sentence quotes: text from a file or a board, and the reason of an error."""

from __future__ import annotations


def shown(text: str, longest: int = 40) -> str:
    """``text`` quoted for a sentence, on one line and of bounded length."""
    return ascii(text if len(text) <= longest else text[: longest - 3] + "...")


def reason(error: BaseException) -> str:
    """What an error tells, on one line and without its full stop."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split()).rstrip(".")


def printable(text: str, ascii_only: bool = False) -> str:
    """``text`` with "?" for every character that does not print: controls and escapes, ends of lines, half pairs of
    UTF-16, marks that turn the direction of writing; with ``ascii_only`` also for every one beyond ASCII."""
    return "".join(one if one.isprintable() and (one.isascii() or not ascii_only) else "?" for one in text)
