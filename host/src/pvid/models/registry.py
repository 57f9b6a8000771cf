"""The shipped mechanisms, and what a call names beside them.

A mechanism is a `str`, the name of a shipped one, a `Path`, a model file, which is Python and runs, or a `Model` of the
program that calls. Texts (a rig file, a log) contain `str` alone; `asked_for` alone makes a `Path`, of what the user of
this call named himself.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, TypeAlias

from pvid.base.errors import PvidError
from pvid.base.wording import printable

if TYPE_CHECKING:  # it loads SymPy
    from pvid.model.description import Model

Mechanism: TypeAlias = "str | Path | Model"

DESCRIPTION = "mechanism.py"  # of a shipped mechanism, in its folder
_FOLDER = Path(__file__).parent


def names() -> tuple[str, ...]:
    """Of the shipped mechanisms."""
    return tuple(sorted(path.parent.name for path in _FOLDER.glob(f"*/{DESCRIPTION}")))


def asked_for(model: str | os.PathLike[str] | Model) -> Mechanism:
    """The mechanism that `--model` of this call, or the argument `model` of a function, names or is."""
    if isinstance(model, str | os.PathLike):
        return str(model) if str(model) in names() else Path(model)
    return model


def most_specific(columns: Mapping[str, Collection[str]]) -> tuple[str, ...]:
    """Of mechanisms, each with the columns of a file that it uses: those whose columns are not a part of another's."""
    sets = {name: frozenset(used) for name, used in columns.items()}
    return tuple(name for name, used in sets.items() if not any(used < other for other in sets.values()))


def is_named(asked: Mechanism, name: str) -> bool:
    """Whether the text of a log names the mechanism of this call; of a model file it has the name without the folder,
    but older versions wrote the path. A model may be that of any file."""
    if not isinstance(asked, str | Path):
        return name.endswith(".py")
    return asked == name if isinstance(asked, str) else PureWindowsPath(name).name == asked.name


def shipped(name: str, where: str = "this recording") -> str:
    """The name of a shipped mechanism in a text, which may come from anybody.

    Raises PvidError where it is none. A model file is not looked for: a text must not choose what runs.

    Parameters
    ----------
    where : the text, as a sentence names it
    """
    if name in names():
        return name
    if name.endswith(".py"):
        own = printable(name)
        raise PvidError(f"{where} names the model file {own}: add --model {own} to run it")
    raise PvidError(f"{printable(name)}: no such model; give a .py file or one of {', '.join(names())}")
