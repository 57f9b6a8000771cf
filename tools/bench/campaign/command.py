"""The command for many rigs: campaign."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import cast

import click
from rich.console import Console

from pvid.base.console import DONE, progress_bar, write_stderr
from pvid.settings.forms import AnyCore

_WIDTH = 220  # of tables that go into a file


@click.command(name="campaign")
@click.argument("population_path", metavar="[POPULATION]", required=False, type=click.Path(path_type=Path))
@click.option("--rigs", default=190, show_default=True, type=click.IntRange(min=1), help="How many.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Of the rigs.")
@click.option("--core", default="f64", show_default=True, type=click.Choice(["f32", "q31", "f64"]), help="Identifier.")
@click.option("--refine/--no-refine", default=True, show_default=True, help="As for identify.")
@click.option("--scheduler", metavar="ADDRESS", help="Of a running dask.distributed, as tcp://host:8786.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes on this machine.  [default: its processors]")
@click.option("--cache", type=click.Path(path_type=Path), help="Folder that keeps the simulated runs.")
@click.option("--by", "properties", multiple=True, metavar="PROPERTY", help="A table by that property besides.")
@click.option("-o", "--out", required=True, type=click.Path(path_type=Path), help="Parquet file of the records.")
def campaign(
    population_path: Path | None,
    rigs: int,
    seed: int,
    core: str,
    refine: bool,
    scheduler: str | None,
    workers: int | None,
    cache: Path | None,
    properties: tuple[str, ...],
    out: Path,
) -> int:
    """Identifies many random rigs that nobody tuned pvid to, and judges the answers against the truth.

    POPULATION is a TOML file with ranges and conditions; by default the one that comes with pvid. Each rig is simulated
    with the full equations and the imperfections of its condition and identified as `pvid identify` does, on all
    processors of this machine or on a cluster. A campaign that was interrupted goes on where it stopped when the same
    command is given again.
    """
    from bench.campaign import table
    from bench.campaign.population import load, shipped
    from bench.campaign.run import Campaign, run
    from bench.campaign.store import Store
    from pvid.base.errors import PvidError

    for name in properties:
        if name not in table.PROPERTIES:
            raise PvidError(f"--by {name}: not a property; there are {', '.join(table.PROPERTIES)}")
    population = shipped() if population_path is None else load(population_path)
    kept = None if cache is None else cache.resolve()
    task = Campaign(population, rigs, seed, cast(AnyCore, core), refine, kept)
    store = Store(out, task.key)
    begun = sum(rig < rigs for rig in store.records)
    if begun:
        write_stderr(f"pvid: {begun} of {rigs} rigs are done already")
    if store.foreign:
        write_stderr(
            f"pvid: {store.foreign} records in {out.name} or its partial file are left out: they are of another "
            f"population, setting or version of pvid"
        )
    try:
        with progress_bar("rigs", rigs) as advance:
            records = run(task, store, advance, scheduler=scheduler, workers=workers)
    except KeyboardInterrupt:
        write_stderr(f"pvid: {len(store.records)} records are kept in {store.partial}: the same command goes on")
        raise click.Abort from None
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    console.print(table.by_condition(records, population.conditions))
    for name in properties:
        console.print(table.by_property(records, name))
    click.echo(table.LEGEND)
    for reason in table.reasons(records):
        click.echo(f"not published: {reason}")
    click.echo(table.summary(records))
    return DONE
