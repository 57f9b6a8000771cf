"""The rig of a recording: --model, --rig, a log, RUN.toml beside RUN.csv, and --set over any of them; where nothing
names a mechanism, the one whose signals the recording has."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError, UnknownMechanismError
from pvid.base.toml_text import toml_document
from pvid.base.wording import listed, typed_name
from pvid.log.rig import LOG_SUFFIX, document_of_log, mechanism_of_log, named_in
from pvid.model.description import Model
from pvid.models.mechanisms import compiled_of, unused_input
from pvid.models.mechanisms import described as description_of
from pvid.models.registry import Mechanism, asked_for, is_named, most_specific, names, shipped
from pvid.rig.columns import Columns, MissingColumnError, parsed
from pvid.rig.former import translated
from pvid.rig.mechanism_file import (
    MechanismRig,
    channels_of,
    parsed_file,
    refuse_other_keys,
    rig_path_of,
    with_settings,
)
from pvid.rig.run import is_run, read_recording


def rig_of(
    run_path: Path | None,
    rig_path: Path | None = None,
    settings: Sequence[str] = (),
    model: str | os.PathLike[str] | Model | None = None,
    columns: str | None = None,
    read: Callable[[Columns], object] | None = None,
) -> MechanismRig:
    """The rig of a recording.

    Raises PvidError where the file cannot be read, a key or a value is wrong, a constant that differs from rig to rig
    has no value, no mechanism is named and none or several have the signals of the recording, or a log or rig file
    names a model file that `model` does not name: what they name is never run.

    Parameters
    ----------
    run_path, rig_path : a log has its own rig, a run may have a rig file beside it; the other one comes before both
    settings : `KEY=VALUE`, which come before the file; the name of a constant of the mechanism alone is a key as well
    model : name, model file or model of this call, before both
    columns : the text of --columns
    read : reads the recording, where it is no file
    """
    asked = None if model is None else asked_for(model)
    where = "this recording" if rig_path is None else str(rig_path)
    document = _document(run_path, rig_path, asked)
    document = with_settings(document, settings)
    name = asked if asked is not None else named_in(document)
    if name is None:
        name = _proposed(run_path, read, columns)
    if isinstance(name, str):
        name = shipped(name, where)
        document = translated(document, name)
    compiled = compiled_of(name)
    constants = {one.name: document.pop(one.name) for one in compiled.knowns if one.name in document}
    if constants:
        document = with_settings(document, [f"known.{key}={value}" for key, value in constants.items()])
    refuse_other_keys(document, compiled)
    rig = MechanismRig.of_document(document, name)
    rig.refuse_lacking(compiled)
    return rig


def common_rig(
    run_paths: Sequence[Path],
    rig_path: Path | None = None,
    settings: Sequence[str] = (),
    model: str | os.PathLike[str] | Model | None = None,
    columns: str | None = None,
) -> MechanismRig:
    """The rig of recordings of one mechanism; see `rig_of`.

    Raises PvidError also where their rig files differ; a recording without one has that of the first.
    """
    first, *others = run_paths
    rig = rig_of(first, rig_path, settings, model, columns)
    for path in others if rig_path is None else ():
        has_own = path.suffix == LOG_SUFFIX or rig_path_of(path).is_file()
        if has_own and rig_of(path, None, settings, model, columns) != rig:
            raise PvidError(f"the rig files of {first.name} and {path.name} differ: name that of both with --rig")
    return rig


def _document(run_path: Path | None, rig_path: Path | None, asked: Mechanism | None) -> Mapping[str, Any]:
    """The tables of the file that a rig is in; none: it is in none."""
    if rig_path is None and run_path is not None and is_run(run_path) and rig_path_of(run_path).is_file():
        rig_path = rig_path_of(run_path)
    if rig_path is not None:
        return parsed_file(rig_path, toml_document)
    if run_path is not None and run_path.suffix == LOG_SUFFIX:
        logged = document_of_log(run_path)
        if logged is not None and (asked is None or is_named(asked, named_in(logged) or "")):
            return logged
    if run_path is not None and not run_path.exists():
        raise PvidError(f"{run_path} does not exist")
    return {}


def _proposed(run_path: Path | None, read: Callable[[Columns], object] | None, columns: str | None) -> str:
    """The shipped mechanism whose signals a recording has, or that a board named.

    Raises PvidError where none has, or several have. One whose signals are a part of another's is not counted: a file
    with the columns of a driven motor is of that, not of a motor that runs out.
    """
    if run_path is not None and run_path.suffix == LOG_SUFFIX:
        return mechanism_of_log(run_path).name
    if read is None and run_path is not None:
        read = partial(read_recording, run_path, None)
    if read is None:
        raise PvidError(f"no mechanism is named: use --model, with {listed(names(), 'or')}, or a model file")
    columns_of: dict[str, set[str]] = {}
    wrong: dict[str, PvidError] = {}
    there: tuple[str, ...] = ()
    for name in names():
        try:
            wanted = parsed(columns, channels_of(description_of(name)))
        except PvidError:  # --columns names another mechanism's signals
            continue
        try:
            read(wanted)
        except MissingColumnError as error:
            there = error.names
            continue
        except PvidError as error:  # it has the columns, and something else is wrong
            wrong[name] = error
        columns_of[name] = {one.name for one in description_of(name).signals}
    found = most_specific(columns_of)
    if len(found) > 1 and all(name in wrong for name in found):  # of the file, whatever its mechanism is
        raise wrong[found[0]]
    what = "the data" if run_path is None else str(run_path)
    if len(found) == 1:
        if unused := unused_input(found[0], there):
            raise PvidError(
                f"{what} has the columns of {found[0]}, but {unused}: name the mechanism with --model, and its columns "
                "with --columns"
            )
        return found[0]
    if not found and run_path is not None:
        columns_there = f" {', '.join(there)}" if there else ""
        raise UnknownMechanismError(
            f"{what}: no shipped mechanism has the names of its columns{columns_there}: name one with --model, and "
            f"which column is which signal with --columns; {typed_name()} look shows what the file has",
            run_path,
        )
    if not found:
        signals = [f"{name} ({', '.join(one.name for one in description_of(name).signals)})" for name in names()]
        raise PvidError(
            f"{what}: no shipped mechanism has these columns: name yours with --model, and its columns with --columns; "
            f"they are {listed(signals, 'or')}"
        )
    raise PvidError(f"{what} can be of {listed(found, 'or')}: name the mechanism with --model")
