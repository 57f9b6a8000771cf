"""`pvid.identify`: parameters of a mechanism from a file, a data frame or arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from pvid.api.data import Data, recording_of
from pvid.api.result import Result, of_core, of_mechanism, of_pendulum
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.log.mechanism_settings import common_rig
from pvid.log.rig import LOG_SUFFIX, recording_of_log, run_of_log
from pvid.log.rig_settings import rig_for
from pvid.model.compiled import CompiledModel
from pvid.rig.columns import Columns, parsed
from pvid.rig.described import described as described_by
from pvid.rig.file import RigFile
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import Recording, Run
from pvid.rig.sensor_steps import resolution_note, resolved
from pvid.rig.together import joined, names_of
from pvid.run.advised import identified
from pvid.run.mechanism import model_of, own_of
from pvid.run.mechanism_advice import analysed
from pvid.run.mechanism_core import identify_in_c
from pvid.run.skew import aligned
from pvid.run.wild_samples import without_wild_samples
from pvid.settings.engine_cores import ENGINE_CORES


def identify(
    data: Data | Sequence[Data],
    *,
    model: str | os.PathLike[str] | None = None,
    rig: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    core: Literal["f32", "q31", "f64"] | None = None,
    settings: Mapping[str, Any] | None = None,
    own: Sequence[str] = (),
    shared: Sequence[str] = (),
    **keys: Any,
) -> Result:
    """Identifies a mechanism from measured data.

    Parameters
    ----------
    data
        A table (csv, npz, parquet, ...), the log of a board, a data frame, a structured array, or a mapping of names
        to arrays, shape (n,): the time t [s] and the signals of the mechanism; of the pendulum phi [rad] and y [m].
        A list of these is several recordings that are identified together: their parameters are the same.
    model
        A mechanism of `pvid models` or a model file; the rig file's or the pendulum by default.
    rig
        The rig file; RUN.toml beside RUN.csv by default.
    columns
        Names and units of the columns, as for `--columns`: "t=time_ms:ms,phi=angle:deg,y=h:mm".
    core
        Arithmetic: float32 by default for the pendulum, float64 for other mechanisms,
        whose C core is compiled for f32 and q31.
    own, shared
        Of several recordings: unknowns with a value of their own in each, such as a payload, `m[A]` and `m[B]`; offsets
        of sensors, which have their own, with one value in all.
    settings, keys
        Keys of the rig file, which come before the file: l1=0.25, settings={"sensor.phi_lsb": 0.0015}.

    Returns
    -------
    Also where the data do not suffice: `Result.identified` is False then.

    Raises
    ------
    PvidError
        When the data or the rig cannot be read; one sentence names the thing and the likely cause.

    Examples
    --------
    >>> pvid.identify("run.csv", l1=0.25)["g"].value  # doctest: +SKIP
    """
    # Matrices are small: threads would wait for each other, on all cores.
    with threadpool_limits(limits=1, user_api="blas"):
        return _identify(data, model, rig, columns, core, {**(settings or {}), **keys}, own, shared)


def _identify(
    data: Data | Sequence[Data],
    model: str | os.PathLike[str] | None,
    rig: str | os.PathLike[str] | None,
    columns: str | None,
    core: Literal["f32", "q31", "f64"] | None,
    settings: Mapping[str, Any],
    own: Sequence[str],
    shared: Sequence[str],
) -> Result:
    several = list(data) if isinstance(data, list | tuple) else [data]
    if not several:
        raise PvidError("data: the list of recordings is empty")
    paths = [Path(one) if isinstance(one, str | os.PathLike) else None for one in several]
    texts = tuple(f"{key}={_toml(value)}" for key, value in settings.items())
    rig_path = None if rig is None else Path(rig)
    files = [one for one in paths if one is not None]
    asked = None if model is None else os.fspath(model)
    described = common_rig(files, rig_path, texts, asked, len(several) > 1)
    if described is not None:
        described = described_by(described) if isinstance(described, RigFile) else described
        compiled = model_of(described)
        given = parsed(columns, channels_of(compiled))
        parts = [_part(*one, described.sample_rate, given, compiled) for one in zip(several, paths, strict=True)]
        recording = joined(parts, _names(paths), given)
        engine = ENGINE_CORES.get(core or "")
        of_each = own_of(compiled, recording, own, shared, in_c=engine is not None)
        answer = analysed(recording, compiled, own=of_each)
        return of_mechanism(answer) if engine is None else of_core(identify_in_c(answer, engine.name))
    if own or shared:
        raise PvidError("own and shared are for several recordings")
    path = paths[0]
    file = rig_for(path, rig_path, texts)
    if core is not None:
        file = replace(file, identifier=replace(file.identifier, core=core))
    if path is not None and path.suffix == LOG_SUFFIX:
        run = run_of_log(path)
    else:
        run = Run.of(recording_of(several[0], path, file.sample_rate, parsed(columns)))
    run = aligned(run, file.sensor.y_delay)
    if not file.identifier.core_traits.takes_gaps:
        run = run.whole()
    before, file = file, resolved(file, run)
    run = replace(run, notes=(*run.notes, *resolution_note(before, file)))
    return of_pendulum(identified(run, file, Native()), model_of(described_by(file)))


def _part(data: Data, path: Path | None, rate: float | None, columns: Columns, model: CompiledModel) -> Recording:
    """One recording of a described mechanism."""
    if path is not None and path.suffix == LOG_SUFFIX:
        recording = recording_of_log(path, [one.name for one in model.signals])
    else:
        recording = recording_of(data, path, rate, columns)
    return without_wild_samples(recording, model)


def _names(paths: Sequence[Path | None]) -> tuple[str, ...]:
    """Of recordings: by their files, or their numbers where one is none."""
    files = [one for one in paths if one is not None]
    return names_of(files) if len(files) == len(paths) else tuple(str(k) for k in range(1, len(paths) + 1))


def _toml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
