"""Identifies the recordings of a fleet in parallel, each once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from pvid.base.cluster import client, each, processors
from pvid.base.errors import PvidError
from pvid.fleet.dates import boards_of
from pvid.fleet.row import Question, Row, row_of
from pvid.fleet.store import Store
from pvid.log.rig import LOG_SUFFIX


def run(
    paths: Iterable[str],
    question: Question,
    store: Store,
    progress: Callable[[int], object],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    together: bool = False,
) -> list[Row]:
    """Identifies what the store does not have yet, and writes its file; a row for each path, by board and time.

    Raises PvidError when there is no path, or as of pvid.base.cluster.client.

    Parameters
    ----------
    paths : of the recordings; workers on other machines read them under the same names
    progress : called with the number of recordings that are done
    scheduler : address of a running scheduler of dask.distributed; None: processes on this machine
    workers : number of these processes; None: one a processor. One is this process
    together : recordings of one folder are identified together, and have one row
    """
    files = list(dict.fromkeys(str(Path(one)) for one in paths))
    if not files:
        raise PvidError("there is no recording to identify: name files, or a pattern in quotes")
    places: list[str | tuple[str, ...]] = [*(_of_one_folder(files) if together else files)]
    rows: dict[str | tuple[str, ...], Row] = {}
    for place in places if store.rows else ():  # else nothing is kept, and workers read the files anyway
        kept = store.rows.get(_key(place, question))
        if kept is not None and (question.reports is None or (kept.report and Path(kept.report).is_file())):
            rows[place] = kept
    progress(len(rows))
    missing = [place for place in places if place not in rows]
    if missing:
        done: dict[str, Row] = {}
        with client(scheduler, min(workers or processors(), len(missing))) as connected:
            for row in each(connected, row_of, missing, question=question):
                store.add(row)
                done[row.path] = row
                progress(len(rows) + len(done))
        rows |= {place: done[_path(place)] for place in missing}
    boards = {} if together else boards_of(path for path in map(Path, files) if path.suffix != LOG_SUFFIX)
    own = (replace(row, board=boards.get(Path(row.path), row.board)) for row in rows.values())
    found = sorted(own, key=lambda row: (row.board, row.began, row.path))
    store.finish(found)
    return found


def _of_one_folder(files: Sequence[str]) -> list[tuple[str, ...]]:
    """The files of each folder, in the order of their names."""
    folders: dict[str, list[str]] = {}
    for one in files:
        folders.setdefault(str(Path(one).parent), []).append(one)
    return [tuple(sorted(own)) for own in folders.values()]


def _path(place: str | tuple[str, ...]) -> str:
    """As in its row."""
    return place if isinstance(place, str) else str(Path(place[0]).parent)


def _key(place: str | tuple[str, ...], question: Question) -> str:
    try:
        return question.key(*map(Path, [place] if isinstance(place, str) else place))
    except OSError:
        return ""
