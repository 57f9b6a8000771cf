"""The exceptions that are meant for the user."""

from __future__ import annotations

from pathlib import Path


class PvidError(Exception):
    """Bad input or usage, explained in one sentence.

    The command line prints the sentence on stderr and exits with code 2; a traceback would not help.
    """


class UnknownMechanismError(PvidError):
    """No shipped mechanism has the columns of a file at `path`; the command line adds what they can be of."""

    def __init__(self, sentence: str, path: Path) -> None:
        super().__init__(sentence)
        self.path = path
