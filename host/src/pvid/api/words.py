"""Sentences that name options of the command line, in the words of Python."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping

from pvid.base.errors import PvidError

_TYPED = r"'[^']*'|\S*[^\s.,;:)]"
_COLUMNS = re.compile(rf"--columns (?P<text>(?=\S*=)(?:{_TYPED}))")
_SETTINGS = re.compile(rf"--set (?P<first>{_TYPED})(?: --set (?:{_TYPED}))*")
_NAMES = re.compile(r"--(?P<name>own|shared) (?P<text>\w+(?:,\w+)*)")
_FILE = re.compile(r"--(?P<name>model|rig) (?P<text>\S+\.\w+)")
_NOT_THERE = " (--weights sensors)"  # the words before it state the same
_ALONE = re.compile(r"--(?P<name>columns|model|rig|own|shared)\b(?P<colon>:?)")


def in_python(sentence: str) -> str:
    """A sentence with the arguments of `pvid.identify` in place of options: --set l1=0.3 is l1=0.3."""
    sentence = _COLUMNS.sub(lambda one: f"columns={_literal(_bare(one['text']))}", sentence)
    sentence = _SETTINGS.sub(lambda one: _settings(one[0].split("--set ")[1:]), sentence)
    sentence = _NAMES.sub(lambda one: f"{one['name']}={one['text'].split(',')}", sentence.replace(_NOT_THERE, ""))
    sentence = _FILE.sub(r'\g<name>="\g<text>"', sentence)
    return _ALONE.sub(lambda one: f"{one['name']}{':' if one['colon'] else '=...'}", sentence)


@contextlib.contextmanager
def words_of_python() -> Iterator[None]:
    """Refusals in the words of Python."""
    try:
        yield
    except PvidError as error:
        error.args = tuple(in_python(one) if isinstance(one, str) else one for one in error.args)
        raise


def columns_text(columns: str | Mapping[str, str | int] | None) -> str | None:
    """The text of --columns of a mapping of signals to columns, as {"phi": "angle, raw:deg"}; a text is itself; None:
    the columns have the names of the signals.

    Raises
    ------
    PvidError
        Where it is neither.
    """
    if columns is None or isinstance(columns, str):
        return columns
    if not isinstance(columns, Mapping):
        raise PvidError(
            'columns: a text is wanted, as "t=time_ms:ms,phi=angle", or a mapping of signals to columns, not '
            f"{type(columns).__name__}"
        )
    return ",".join(f"{signal}={_quoted(str(column))}" for signal, column in columns.items()) or None


def _quoted(column: str) -> str:
    """COLUMN or COLUMN:UNIT, the name in double quotes unless it is."""
    if column.lstrip().startswith('"') or not column.strip():
        return column
    name, colon, unit = column.rpartition(":") if ":" in column else (column, "", "")
    return '"' + name.replace('"', '""') + f'"{colon}{unit}'


def _bare(text: str) -> str:
    return text.strip("'")


def _literal(text: str) -> str:
    return f"'{text}'" if '"' in text else f'"{text}"'


def _settings(texts: list[str]) -> str:
    """`known.l1=0.3` and others as arguments: the constants of a mechanism have no table."""
    given = [_bare(one.strip()).removeprefix("known.").partition("=") for one in texts]
    keys = [f"{key}={value}" for key, _, value in given if key.isidentifier()]
    others = [f"{_literal(key)}: {value}" for key, _, value in given if not key.isidentifier()]
    return ", ".join([*keys, *([f"settings={{{', '.join(others)}}}"] if others else [])])
