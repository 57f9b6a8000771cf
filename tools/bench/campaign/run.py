"""A campaign: rigs simulated and identified in parallel, through dask.distributed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from bench.campaign.judge import Record, identify_rig
from bench.campaign.population import Population
from bench.campaign.store import Store, code_version, core_version
from bench.campaign.truth import GENERATOR, kept_rig, simulate_rig
from pvid.base.cluster import client, each, processors
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.settings.forms import AnyCore


@dataclass(frozen=True)
class Campaign:
    """What is run: rigs 0 to `rigs` - 1 of a seed, identified by a core, refined or not.

    `cache`: a folder that keeps the simulated runs; None: they are simulated anew.
    """

    population: Population
    rigs: int
    seed: int = 1
    core: AnyCore = "f64"
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
        Number of them; by default, one a processor. One is this process.
    """
    rigs = range(campaign.rigs)
    missing = [rig for rig in rigs if rig not in store.records]
    done = campaign.rigs - len(missing)
    progress(done)
    if missing:
        with client(scheduler, min(workers or processors(), len(missing))) as connected:
            code = code_version()
            for record in each(connected, _work, missing, campaign=campaign, code=code):
                store.add(record)
                done += 1
                progress(done)
    return store.finish(rigs)


def _work(rig: int, *, campaign: Campaign, code: str) -> Record:
    """One rig, on a worker."""
    if code_version() != code:
        raise PvidError("a worker of the scheduler has another version of pvid than this machine: install the same one")
    native = _native()
    if campaign.cache is None:
        simulated = simulate_rig(native, campaign.population, campaign.seed, rig)
    else:
        simulated = kept_rig(native, campaign.population, campaign.seed, rig, campaign.cache)
    return identify_rig(simulated, campaign.core, refine=campaign.refine)[0]


@lru_cache(maxsize=1)
def _native() -> Native:
    return Native()
