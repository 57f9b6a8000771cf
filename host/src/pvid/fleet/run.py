"""Identifies the recordings of a fleet in parallel, each once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from pvid.base.cluster import client, each, processors
from pvid.base.errors import PvidError
from pvid.fleet.row import Question, Row, row_of
from pvid.fleet.store import Store


def run(
    paths: Iterable[str],
    question: Question,
    store: Store,
    progress: Callable[[int], object],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> list[Row]:
    """Identifies what the store does not have yet, and writes its file; a row for each path, by board and time.

    Parameters
    ----------
    paths : of the recordings; workers on other machines read them under the same names
    progress : called with the number of recordings that are done
    scheduler : address of a running scheduler of dask.distributed; None: processes on this machine
    workers : number of these processes; None: one a processor. One is this process

    Raises
    ------
    PvidError
        When there is no path, or as of pvid.base.cluster.client.
    """
    places = list(dict.fromkeys(str(Path(one)) for one in paths))
    if not places:
        raise PvidError("there is no recording to identify: name files, or a pattern in quotes")
    rows: dict[str, Row] = {}
    for place in places if store.rows else ():  # else nothing is kept, and workers read the files anyway
        kept = store.rows.get(_key(place, question))
        if kept is not None:
            rows[place] = kept
    progress(len(rows))
    missing = [place for place in places if place not in rows]
    if missing:
        with client(scheduler, min(workers or processors(), len(missing))) as connected:
            for row in each(connected, row_of, missing, question=question):
                store.add(row)
                rows[row.path] = row
                progress(len(rows))
    found = sorted(rows.values(), key=lambda row: (row.board, row.began, row.path))
    store.finish(found)
    return found


def _key(place: str, question: Question) -> str:
    try:
        return question.key(Path(place))
    except OSError:
        return ""
