"""`pvid sizes`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.page_table import UPDATE, put_table, table_in
from pvid.cli.results import DATA, put_results
from pvid.settings.enums import Core
from pvid.settings.forms import FORMS


@click.command(name="sizes")
@UPDATE
@DATA
@click.option(
    "--budget", type=click.Path(path_type=Path, exists=True), help="Write the measured figures to this budget file."
)
@click.option(
    "--check", type=click.Path(path_type=Path, exists=True), help="Compare the measured figures with this budget file."
)
@click.option("--model", "models", multiple=True, metavar="NAME", help="The weak form of a mechanism; may be repeated.")
@click.option("--core", type=click.Choice(["f32", "q31"]), help="Arithmetic of --model.  [default: f32]")
@click.option("--json", "as_json", is_flag=True, help="Write the figures as JSON.")
@click.argument("targets", nargs=-1, metavar="[TARGET]...")
@click.option("--profile", "profiled", metavar="BOARD", help="Count the instructions of a tick on BOARD by function.")
def command(
    update: Path | None,
    data: Path | None,
    budget: Path | None,
    check: Path | None,
    profiled: str | None,
    models: tuple[str, ...],
    core: Core | None,
    as_json: bool,
    targets: tuple[str, ...],
) -> int:
    """Measures flash, RAM, stack and instructions per tick, built and run in an emulator: on every board, or on those
    named as TARGET.

    --update host/docs/firmware.md measures what the rows of its table `costs` name, and replaces their figures.
    """
    from pvid.board import boards, sizes

    if core is not None and not models:
        raise PvidError("--core is for --model: without it both are measured")
    if profiled is not None:
        if budget is not None or check is not None:
            raise PvidError("--profile has no budget: omit --budget and --check")
        from pvid.board import profile

        on = boards.board(profiled)
        profiles = {name: profile.profile(on, "weak", core or "f32", name) for name in models} or {
            **{form: profile.profile(on, form) for form in FORMS},
            sizes.REFINED: profile.refined(on),
            sizes.IN_BLOCKS: profile.in_blocks(on),
        }
        put_results(data, "profile", profile.HEADER, profile.table_rows(profiles))
        return DONE
    whole = [one for one in (budget, check) if one is not None]
    if (targets or models) and (update is not None or whole):
        raise PvidError("--update, --budget and --check measure every board: name no TARGET and no --model")
    named = [boards.board(name) for name in targets] or list(boards.BOARDS.values())
    summary = None if update is None else table_in(update, sizes.SUMMARY)
    if update is not None and summary is None:
        raise PvidError(f"{update} has no table {sizes.SUMMARY}")
    chosen = sizes.configurations_on(named, models, core or "f32")
    if summary is not None:
        if whole or data is not None:
            raise PvidError(f"{update} names some boards; --data, --budget and --check measure every board")
        chosen = sizes.named_in(summary)
    footprints = {}
    with progress_bar("boards", len(chosen)) as advance:
        for done, configuration in enumerate(chosen):
            footprints[configuration] = sizes.measure(configuration)[0]
            advance(done + 1)
    if as_json:
        click.echo(json.dumps(sizes.as_json(footprints), indent=2))
        return DONE
    if summary is not None:
        put_table(update, sizes.SUMMARY, sizes.with_costs(summary, footprints))
        return DONE
    put_results(data, "sizes-models" if models else "sizes", sizes.HEADER, sizes.table_rows(footprints))
    if budget is not None:
        sizes.write_budget(budget, footprints)
    excess = sizes.over_budget(check, footprints) if check is not None else []
    for sentence in excess:
        write_stderr(f"pvid: over budget: {sentence}")
    return DIFFERENT if excess else DONE
