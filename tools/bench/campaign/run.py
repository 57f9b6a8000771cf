"""A campaign: rigs simulated and identified in parallel, through dask.distributed."""

from __future__ import annotations

import hashlib
import importlib
import logging
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from bench.campaign.judge import Record, identify_rig
from bench.campaign.population import Population
from bench.campaign.store import Store, code_version, core_version
from bench.campaign.truth import GENERATOR, kept_rig, simulate_rig
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.rig.file import Core

_CONNECT_S = 10
_WORKERS_S = 30  # until a running scheduler must have a worker


@dataclass(frozen=True)
class Campaign:
    """What is run: rigs 0 to `rigs` - 1 of a seed, identified by a core, refined or not.

    `cache`: a folder that keeps the simulated runs; None: they are simulated anew.
    """

    population: Population
    rigs: int
    seed: int = 1
    core: Core = "f32"
    refine: bool = True
    cache: Path | None = None

    @property
    def key(self) -> str:
        """What a record depends on beside the rig's index: population, settings, code."""
        parts = (
            self.population.hash,
            GENERATOR,
            self.seed,
            self.core,
            self.refine,
            code_version(),
            core_version(),
        )
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def run(
    campaign: Campaign,
    store: Store,
    progress: Callable[[int], object],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> list[Record]:
    """Runs what the store does not have yet, and writes its file; the records of all rigs, in order.

    Parameters
    ----------
    progress
        Called with the number of rigs that are done.
    scheduler
        Address of a running scheduler; by default processes on this machine.
    workers
        Number of them; by default, one a processor.
    """
    rigs = range(campaign.rigs)
    missing = [rig for rig in rigs if rig not in store.records]
    done = campaign.rigs - len(missing)
    progress(done)
    if missing:
        with _client(scheduler, min(workers or _processors(), len(missing))) as client:
            for record in _records(client, campaign, missing):
                store.add(record)
                done += 1
                progress(done)
    return store.finish(rigs)


def _records(client: Any, campaign: Campaign, rigs: list[int]) -> Iterator[Record]:
    futures = client.map(_work, rigs, campaign=campaign, code=code_version(), pure=False)
    for future in _distributed().as_completed(futures, loop=client.loop):
        try:
            yield future.result()
        except PvidError:
            raise
        except Exception as error:
            raise PvidError(f"a worker cannot run pvid: {type(error).__name__}: {error}") from error
        finally:
            future.release()


def _work(rig: int, *, campaign: Campaign, code: str) -> Record:
    """One rig, on a worker."""
    if code_version() != code:
        raise PvidError("a worker of the scheduler has another version of pvid than this machine: install the same one")
    native = _native()
    if campaign.cache is None:
        simulated = simulate_rig(native, campaign.population, campaign.seed, rig)
    else:
        simulated = kept_rig(native, campaign.population, campaign.seed, rig, campaign.cache)
    return identify_rig(native, simulated, campaign.core, refine=campaign.refine)[0]


@lru_cache(maxsize=1)
def _native() -> Native:
    return Native()


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the scheduler, or of worker processes of its own that nobody else can reach."""
    distributed = _distributed()
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise PvidError(
                f"no scheduler of dask.distributed can be reached at {scheduler} within {_CONNECT_S} s: is it "
                f"running, and is the address that which it prints (tcp://HOST:PORT)?"
            ) from error
        with client:
            try:
                client.wait_for_workers(1, timeout=_WORKERS_S)
            except TimeoutError as error:
                raise PvidError(f"the scheduler at {scheduler} has no worker: start one with dask worker") from error
            yield client
        return
    with (
        tempfile.TemporaryDirectory(prefix="pvid-campaign-") as folder,
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
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise PvidError("a campaign needs the Python package distributed, which is not installed") from error


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
