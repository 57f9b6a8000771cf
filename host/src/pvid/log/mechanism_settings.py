"""The rig of a mechanism with a compiled model: --model, --rig, a log, RUN.toml beside RUN.csv, and --set over any of
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.log.rig import LOG_SUFFIX, described_document_of_log
from pvid.log.rig_settings import rig_for
from pvid.models.registry import DEFAULT, MODELS, asked_for, is_named, shipped
from pvid.rig.file import RigFile, parsed_file, rig_path_of
from pvid.rig.mechanism_file import MechanismRig, with_settings
from pvid.rig.run import is_run


def mechanism_rig(
    run_path: Path | None, rig_path: Path | None, settings: Sequence[str], model: str | None
) -> MechanismRig | None:
    """The rig of a run of a described mechanism; None: it is one that the C core identifies.

    Parameters
    ----------
    run_path, rig_path : a log has its own rig, a run may have a rig file beside it; the other one comes before both
    settings : `KEY=VALUE`, which come before the file
    model : name or model file of this call, before both

    Raises
    ------
    PvidError
        Where the file cannot be read, a key or a value is wrong, or a log or rig file names a model file that `model`
        does not name: what they name is never run.
    """
    asked = None if model is None else asked_for(model)
    where = "this recording" if rig_path is None else str(rig_path)
    if rig_path is None and run_path is not None and is_run(run_path) and rig_path_of(run_path).is_file():
        rig_path = rig_path_of(run_path)
    if rig_path is None and run_path is not None and run_path.suffix == LOG_SUFFIX:
        logged = described_document_of_log(run_path)
        if logged is not None and (asked is None or is_named(asked, logged["model"]["name"])):
            return _of_document(with_settings(logged, settings), asked, where)
    if model is None and rig_path is None:
        return None
    document = {} if rig_path is None else parsed_file(rig_path, toml_document)
    table = document.get("model", {})
    name = model or (table.get("name", DEFAULT) if isinstance(table, dict) else DEFAULT)
    if isinstance(name, str) and name in MODELS and not _is_described(document):
        return None
    return _of_document(with_settings(document, settings), asked, where)


def common_rig(
    run_paths: Sequence[Path], rig_path: Path | None, settings: Sequence[str], model: str | None, several: bool = False
) -> MechanismRig | RigFile | None:
    """The rig of recordings of one mechanism; see `mechanism_rig`.

    Parameters
    ----------
    run_paths : files among the recordings
    several : there are several recordings, which are of a described mechanism: a rig file of the pendulum's own stands
        for that of its description

    Raises
    ------
    PvidError
        Also where their rig files differ; a recording without one has that of the first.
    """

    def rig_of(path: Path | None) -> MechanismRig | RigFile | None:
        found = mechanism_rig(path, rig_path, settings, model)
        return found if found is not None or not several else rig_for(path, rig_path, settings)

    if not run_paths:
        return rig_of(None)
    first, *others = run_paths
    rig = rig_of(first)
    for path in others if rig_path is None else ():
        has_own = path.suffix == LOG_SUFFIX or rig_path_of(path).is_file()
        if has_own and rig_of(path) != rig:
            raise PvidError(f"the rig files of {first.name} and {path.name} differ: name that of both with --rig")
    return rig


def _of_document(document: Mapping[str, Any], asked: str | Path | None, where: str) -> MechanismRig:
    rig = MechanismRig.of_document(document, asked)
    if isinstance(rig.model, str):
        shipped(rig.model, where)
    return rig


def _is_described(document: Mapping[str, Any]) -> bool:
    """Whether the file of a mechanism that the core has a form of its own for is that of its description, as `pvid
    model simulate` writes it: with a table for each sensor."""
    sensors = document.get("sensor")
    return isinstance(sensors, dict) and bool(sensors) and all(isinstance(one, dict) for one in sensors.values())
