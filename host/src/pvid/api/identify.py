"""`pvid.identify`: parameters of a mechanism from a file, a data frame or arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from pvid.api.data import Data, named
from pvid.api.result import Result, result_of
from pvid.api.words import columns_text, words_of_python
from pvid.base.errors import PvidError
from pvid.identification.analysis import own_of
from pvid.identification.core import identify_in_c
from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.identification.robot import answer_of_robot
from pvid.identification.robot_core import answer_of_robot_in_c
from pvid.identification.summary import Made
from pvid.log.rig import source_of
from pvid.log.rig_choice import common_rig, rig_of
from pvid.model.description import Model
from pvid.rig.run import recording_of_arrays
from pvid.rig.together import names_of
from pvid.settings.cores import CORES


def identify(
    data: Data | Sequence[Data],
    *,
    model: str | os.PathLike[str] | Model | None = None,
    rig: str | os.PathLike[str] | None = None,
    columns: str | Mapping[str, str | int] | None = None,
    core: Literal["f32", "q31", "f64"] | None = None,
    refine: bool | None = None,
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
        to arrays, shape (n,): the time t [s] and the signals of the mechanism. A list of these is several recordings
        that are identified together: their parameters are the same.
    model
        A mechanism of `pvid models`, a model file or a `pvid.Model`; by default that of the rig file, else the shipped
        one with the signals of the data.
    rig
        The rig file; RUN.toml beside RUN.csv by default.
    columns
        Names and units of the columns, as for `--columns`: "t=time_ms:ms,phi=angle:deg,y=h:mm", or a mapping with the
        same columns: {"t": "time_ms:ms", "phi": "angle:deg"}. The result keeps them for other recordings.
    core
        Arithmetic: float64 by default; the C core in f32 or q31 is compiled for the mechanism.
    refine
        In float64: the full equations are fitted to the whole run; by default of a model that has equations of its own
        for it.
    own, shared
        Of several recordings: unknowns with a value of their own in each, such as a payload, `m[A]` and `m[B]`; offsets
        of sensors, which have their own, with one value in all.
    settings, keys
        Keys of the rig file, which come before the file, and constants: l1=0.25,
        settings={"sensor.phi.resolution": 0.0015}.

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
    with words_of_python():
        given = {**(settings or {}), **keys}
        return identify_typed(data, model, rig, columns_text(columns), core, refine, given, own, shared)


def identify_typed(
    data: Data | Sequence[Data],
    model: str | os.PathLike[str] | Model | None,
    rig: str | os.PathLike[str] | None,
    columns: str | None,
    core: Literal["f32", "q31", "f64"] | None,
    refine: bool | None,
    settings: Mapping[str, Any],
    own: Sequence[str],
    shared: Sequence[str],
) -> Result:
    """As `identify`; refusals name the options of the command line."""
    # Matrices are small: threads would wait for each other, on all cores.
    with threadpool_limits(limits=1, user_api="blas"):
        several = list(data) if isinstance(data, list | tuple) else [data]
        if not several:
            raise PvidError("data: the list of recordings is empty")
        paths = [Path(one) if isinstance(one, str | os.PathLike) else None for one in several]
        texts = tuple(f"{key}={_toml(value)}" for key, value in settings.items())
        rig_path, asked = None if rig is None else Path(rig), model
        files = [one for one in paths if one is not None]
        if files:
            found = common_rig(files, rig_path, texts, asked, columns)
        else:
            found = rig_of(None, rig_path, texts, asked, columns, partial(recording_of_arrays, named(several[0]), None))
        sources = [
            partial(recording_of_arrays, named(one), found.sample_rate) if path is None else source_of(path)
            for one, path in zip(several, paths, strict=True)
        ]
        recording, compiled = read_all(found, sources, _names(paths), columns)
        in_c = CORES.get(core or "")
        of_each = own_of(compiled, recording, own, shared, in_c=in_c is not None)
        options = {"model": model, "rig": rig, "columns": columns, "core": core, "refine": refine, **settings}
        made = Made.of(_call(paths, options), files, rig_path, found)
        if compiled.chain is not None and core != "q31" and not (refine or own or shared):
            robot = answer_of_robot_in_c if in_c else answer_of_robot
            return result_of(robot(recording, compiled), made, columns)
        answer = identified(recording, compiled, refine=False if in_c else refine, own=of_each)
        return result_of(answer if in_c is None else identify_in_c(answer, in_c.name), made, columns)


def _call(paths: Sequence[Path | None], options: Mapping[str, Any]) -> str:
    """Of `identify`, in words of Python."""
    data = [repr(str(one)) if one is not None else "data" for one in paths]
    named = {name: one.title if isinstance(one, Model) else one for name, one in options.items() if one is not None}
    given = [f"{name}={one if isinstance(one, bool | float | int) else repr(str(one))}" for name, one in named.items()]
    first = data[0] if len(data) == 1 else f"[{', '.join(data)}]"
    return f"pvid.identify({', '.join([first, *given])})"


def _names(paths: Sequence[Path | None]) -> tuple[str, ...]:
    """Of recordings, where there are several: by their files, or their numbers where one is none."""
    if len(paths) == 1:
        return ()
    files = [one for one in paths if one is not None]
    return names_of(files) if len(files) == len(paths) else tuple(str(k) for k in range(1, len(paths) + 1))


def _toml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
