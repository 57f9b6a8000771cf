"""Work in parallel through dask.distributed: on processes of this machine, or on a scheduler that runs already."""

from __future__ import annotations

import importlib
import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from pvid.base.errors import PvidError
from pvid.base.packages import lacking

_CONNECT_S = 10
_WORKERS_S = 30  # until a running scheduler must have a worker

Item = TypeVar("Item")
Done = TypeVar("Done")


def each(client: Any, work: Callable[..., Done], items: Sequence[Item], **fixed: Any) -> Iterator[Done]:
    """The results of work(item, **fixed), as they come.

    Raises PvidError: that of the work, or where a worker cannot run it.

    Parameters
    ----------
    client : of `client`; None: this process does the work
    work : a function that a worker can import
    """
    if client is None:
        yield from (work(item, **fixed) for item in items)
        return
    futures = client.map(work, items, pure=False, **fixed)
    for future in _distributed().as_completed(futures, loop=client.loop):
        try:
            yield future.result()
        except PvidError:
            raise
        except Exception as error:
            raise PvidError(f"a worker cannot run pvid: {type(error).__name__}: {error}") from error
        finally:
            future.release()


@contextmanager
def client(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the scheduler, or of worker processes of its own that nobody else can reach; None for one worker on
    this machine, for which another process and a scheduler take longer to start than most recordings to identify.

    Raises PvidError when the scheduler cannot be reached or has no worker, or dask.distributed is not installed.

    Parameters
    ----------
    scheduler : address of a running scheduler; None: processes on this machine
    workers : number of these processes
    """
    if scheduler is None and workers == 1:
        yield None
        return
    distributed = _distributed()
    if scheduler is not None:
        try:
            made = distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise PvidError(
                f"no scheduler of dask.distributed can be reached at {scheduler} within {_CONNECT_S} s: is it "
                f"running, and is the address that which it prints (tcp://HOST:PORT)?"
            ) from error
        with made:
            try:
                made.wait_for_workers(1, timeout=_WORKERS_S)
            except TimeoutError as error:
                raise PvidError(f"the scheduler at {scheduler} has no worker: start one with dask worker") from error
            yield made
        return
    with (
        tempfile.TemporaryDirectory(prefix="pvid-workers-") as folder,
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # of its bare status pages, which cannot be switched off
            scheduler_kwargs={"dashboard": False},
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as made,
    ):
        yield made


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise lacking("work in parallel", "distributed") from error
