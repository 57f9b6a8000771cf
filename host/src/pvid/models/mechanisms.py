"""Mechanisms that are described and compiled: the shipped ones (folders with mechanism.py) and a user's own file.

Here alone a model file runs, and only one that is given as a Path: see pvid.models.registry.
"""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from pvid import model as language
from pvid.base.errors import PvidError
from pvid.base.wording import listed, printable
from pvid.model.compiled import CompiledModel
from pvid.model.description import Model
from pvid.model.refusal import ModelError, Place
from pvid.models.registry import DESCRIPTION, Mechanism, shipped
from pvid.models.registry import names as names

_FOLDER = Path(__file__).parent
_models: WeakKeyDictionary[Model, tuple[str, CompiledModel]] = WeakKeyDictionary()


def path_of(mechanism: Mechanism) -> tuple[str, Path]:
    """A mechanism's name and file.

    Raises PvidError where there is no shipped mechanism of the name, no such model file, or the mechanism is a model.
    """
    if isinstance(mechanism, str):
        return shipped(mechanism), _FOLDER / mechanism / DESCRIPTION
    if isinstance(mechanism, Model):
        raise PvidError(f"the model {mechanism.title} is in no file: write it to one")
    if mechanism.suffix == ".py" and mechanism.is_file():
        return mechanism.parent.name if mechanism.name == DESCRIPTION else mechanism.stem, mechanism
    raise PvidError(f"{printable(str(mechanism))}: no such model; give a .py file or one of {', '.join(names())}")


def described(mechanism: Mechanism) -> Model:
    """The description in a model file, which may import Python files that lie beside it.

    Raises PvidError where the file cannot be read or run, or leaves no model; the sentence contains the line.
    """
    path = path_of(mechanism)[1]
    return _left_in(_space_of(path), path)[1]


def unused_input(mechanism: str, columns: Collection[str]) -> str:
    """A clause on a column that a shipped mechanism does not use, and that drives another one with all its signals;
    "": there is none."""
    own = {one.name for one in described(mechanism).signals}
    for name in names():
        signals = described(name).signals
        if own < {one.name for one in signals}:
            unused = [one.name for one in signals if one.kind == "input" and one.name in set(columns) - own]
            lacking = [one.name for one in signals if one.name not in columns]
            if unused and lacking:
                many = "column {} is" if len(unused) == 1 else "columns {} are"
                return f"{many.format(listed(unused))} not used: {name} needs {listed(lacking)} as well"
    return ""


def text_with(mechanism: Mechanism, lines: Sequence[str]) -> str:
    """A model file's text with more calls of its model, each as in "add('a*sgn(v)')".

    Raises PvidError as `described`.
    """
    path = path_of(mechanism)[1]
    name, _ = _left_in(_space_of(path), path)
    head = f"# Made by `pvid identify --write-model` from {path.name}; the last lines are new."
    own = path.read_text(encoding="utf-8-sig").rstrip()
    return "\n".join([head, own, "", *(f"{name}.{one}" for one in lines), ""])


def _space_of(path: Path) -> dict[str, Any]:
    """What a model file leaves."""
    space: dict[str, Any] = {"__name__": "pvid_model_file", "__file__": str(path)}
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)
    try:
        exec(compile(path.read_text(encoding="utf-8-sig"), str(path), "exec"), space)
    except ModelError as error:
        raise error.at(Place(str(path), _line(error, path))) from None
    except PvidError:
        raise
    except (OSError, UnicodeDecodeError) as error:
        raise PvidError(f"{path}: {error}") from None
    except SyntaxError as error:
        raise PvidError(f"{Path(error.filename or path).name}, line {error.lineno}: {error.msg}") from None
    except (Exception, SystemExit) as error:
        where = str(Place(str(path), _line(error, path))).removesuffix(": ") or path.name
        said = f"{type(error).__name__}: {' '.join(str(error).split())}{_import(error)}"
        raise PvidError(f"{where}: {_of_numbers(error, path) or said}") from None
    finally:
        sys.path.remove(folder)
    return space


def _left_in(space: dict[str, Any], path: Path) -> tuple[str, Model]:
    """The model that a file leaves, and its name: its variable `model`, or the only Model that it has."""
    model = space.get("model")
    if isinstance(model, Model):
        return "model", model
    others = {id(value): (name, value) for name, value in space.items() if isinstance(value, Model)}
    if len(others) == 1 and model is None:
        return next(iter(others.values()))
    count = f"{len(others)} model{'s' if len(others) > 1 else ''}"
    found = f"{count} and none of them" if others else "no pvid.model.Model"
    raise PvidError(f"{path.name}: the file leaves {found} in a variable `model`")


def _import(error: BaseException) -> str:
    """How to get what a model file forgot to import; "": it is nothing of ours."""
    name = error.name if isinstance(error, NameError) else None
    return f"; add `from pvid.model import {name}`" if name in language.__all__ else ""


def _of_numbers(error: BaseException, path: Path) -> str:
    """What a function of math or numpy was given a signal for; "": it was not that."""
    if not isinstance(error, TypeError) or not re.search("expression to float|ufunc|to complex", str(error)):
        return ""
    lines = [frame.line or "" for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    called = re.search(r"\b(math|cmath|np|numpy)\.(\w+)\s*\(", lines[-1]) if lines else None
    taken = f"{called[1]}.{called[2]}" if called else "a function of math or numpy"
    own = called[2] if called and called[2] in language.__all__ else ""
    return f"{taken} takes numbers: use {own or 'sin, cos, sgn (or the built-in abs)'} of pvid.model"


def _line(error: BaseException, path: Path) -> int:
    """The last line of the file on the way to the error; 0: it is elsewhere."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return (lines[-1] or 0) if lines else 0


def compiled_of(mechanism: Mechanism) -> CompiledModel:
    """A shipped mechanism by its name, a model file by its path, or a model, compiled; kept until it changes."""
    if isinstance(mechanism, Model):
        state = repr(vars(mechanism))
        if _models.get(mechanism, ("",))[0] != state:
            _models[mechanism] = state, mechanism.compiled()
        return _models[mechanism][1]
    name, path = path_of(mechanism)
    return _compiled(name, path, path.stat().st_mtime_ns)


@lru_cache(maxsize=32)
def _compiled(name: str, path: Path, changed: int) -> CompiledModel:
    return described(path).compiled(name)


def constants_of(name: str, values: Mapping[str, float]) -> dict[str, float]:
    """Values of constants, with those of the shipped mechanism for what a rig must give."""
    return {one.name: one.value for one in compiled_of(name).knowns if one.required} | dict(values)
