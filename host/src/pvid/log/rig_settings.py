"""Where a command takes the rig from: --rig, a log, RUN.toml beside RUN.csv, and --set KEY=VALUE over any of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.toml_text import key_and_value
from pvid.log.rig import described_document_of_log, rig_of_log
from pvid.log.rig_choice import document_for
from pvid.models.registry import DEFAULT, MODELS
from pvid.rig.file import RigFile, check_setting, is_strong, load, rig_path_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import is_run


def rig_for(run_path: Path | None, rig_path: Path | None, settings: Iterable[str] = ()) -> RigFile:
    """The rig that a run or a log comes from.

    Parameters
    ----------
    run_path
        A log has its own rig file; a run may have one beside it. None: no run.
    rig_path
        A rig file that comes before both.
    settings
        `KEY=VALUE`, which come before what the file holds; all there is where there is no file.

    Raises
    ------
    PvidError
        When there is neither a rig file nor a setting of l1, or a key or a value is wrong.
    """
    given = parse_settings(settings)
    if rig_path is not None:
        return load(rig_path, given)
    if run_path is not None and not is_run(run_path):
        rig = _of_description(run_path) or rig_of_log(run_path)
        if rig is not None:
            return RigFile.parse(rig.text(), given) if given else rig
    elif run_path is not None and (beside := rig_path_of(run_path)).is_file():
        return load(beside, given)
    if run_path is not None and not run_path.exists():
        raise PvidError(f"{run_path} does not exist")
    model = MODELS[given.get("model", {}).get("name", DEFAULT)]
    missing = [one for one in model.constants if one.name not in given]
    if missing:
        wanted = " and ".join(f"{one.name}, the {one.meaning} [{one.unit}]," for one in missing)
        typed = " ".join(f"--set {one.name}={one.example}" for one in missing)
        raise PvidError(
            f"no rig file: of the pendulum {wanted} is all that is needed: use {typed} with the value of your rig; "
            f"another mechanism is named by --model"
        )
    return RigFile.parse("", given)


def _of_description(log: Path) -> RigFile | None:
    """Of a log of the weak form, whose rig is that of the description."""
    document = described_document_of_log(log) or {}
    if document.get("model", {}).get("name") != DEFAULT:
        return None
    rig = MechanismRig.of_document(document)
    sensor = {f"{name}_lsb": keys["resolution"] for name, keys in rig.sensor.items() if "resolution" in keys}
    nominal = {name: rig.nominal[name] for name in MODELS[DEFAULT].physical_names if name in rig.nominal}
    tables: dict[str, Any] = {"sensor": sensor, "nominal": nominal}
    return RigFile.of_document({"l1": rig.known["l1"], "sample_rate": rig.sample_rate, **tables})


def strong_rig(
    run_path: Path, rig_path: Path | None, settings: Iterable[str], model: str | None, form: str | None
) -> RigFile | None:
    """The pendulum's rig file, where the file or `form` asks for the strong form that is written for it by hand."""
    document = document_for(run_path, rig_path, None) if model in (None, DEFAULT) else {}
    given = list(settings)
    chosen = form or ("strong" if is_strong(document) or "identifier.form=strong" in given else None)
    is_described = "known" in document or any(isinstance(one, dict) for one in document.get("sensor", {}).values())
    if chosen != "strong" or is_described or model not in (None, DEFAULT):
        return None
    rig = rig_for(run_path, rig_path, given)
    return replace(rig, identifier=replace(rig.identifier, form="strong"))


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """`l1=0.25` and `sensor.phi_lsb=0.0015` as the tables of a rig file.

    A value is written as in TOML; the quotes of a word may be left out.

    Raises
    ------
    PvidError
        Naming the key that is unknown, given twice, of the wrong type or out of range.
    """
    document: dict[str, Any] = {}
    for setting in settings:
        key, value = key_and_value(setting, "l1=0.25")
        table, dot, name = key.rpartition(".")
        try:
            value = check_setting(table, name, value)
        except PvidError as error:
            raise PvidError(f"--set {error}") from error
        place = document.setdefault(table, {}) if dot else document
        if name in place:
            raise PvidError(f"--set {key} is given twice")
        place[name] = value
    return document
