"""`pvid tables` and `pvid schema`: C headers of derivative filters and of the link, printed or checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pvid.base.console import DIFFERENT, DONE
from pvid.base.errors import PvidError
from pvid.design.c_tables import bank_header
from pvid.design.fir import finite_difference, savitzky_golay


@click.command(name="tables")
@click.option("--form", type=click.Choice(["fir"]), default="fir", help="A bank of derivative filters.")
@click.option("--name", default="fir_bank", show_default=True, help="Name in C.")
@click.option("--check", type=click.Path(path_type=Path), help="Compare this file with the output instead of printing.")
@click.option("--points", type=int, default=241, show_default=True, help="Points of the Savitzky-Golay window, odd.")
@click.option("--degree", type=int, default=12, show_default=True, help="Degree of its polynomial, 4 to 12.")
@click.option("--difference", is_flag=True, help="Five-point central differences instead.")
@click.option("--stride", type=int, default=1, show_default=True, help="Points from tap to tap.")
@click.option("--block", type=int, default=1, show_default=True, help="Samples whose mean is a point, odd.")
def command(form: str, name: str, check: Path | None, **fir: Any) -> int:
    """Prints a header with a bank of derivative filters (pvid_fir_bank_f32) for the C core.

    `pvid model build --strong --run RUN` chooses the bank of a rig and prints the whole configuration; this command is
    for a bank of your own.
    """
    return _print_header(_fir(name, **fir), check)


@click.command(name="schema")
def schema() -> int:
    """Prints firmware/link/schema.h: the layouts of the frames of the serial link."""
    from pvid.link.frames import c_header

    click.echo(c_header(), nl=False)
    return DONE


def _fir(name: str, points: int, degree: int, difference: bool, stride: int, block: int) -> str:
    if difference and block != 1:
        raise PvidError("--block is for Savitzky-Golay windows: omit it or --difference")
    bank = finite_difference(stride) if difference else savitzky_golay(points, degree, stride, block)
    kind = "--difference" if difference else f"--points {points} --degree {degree}"
    blocks = f" --block {block}" if block > 1 else ""
    return bank_header(bank, name, f"pvid tables --form fir {kind} --stride {stride}{blocks} --name {name}")


def _print_header(header: str, check: Path | None) -> int:
    """Prints a generated header, or compares the file `check` with it."""
    if check is None:
        click.echo(header, nl=False)
        return DONE
    try:
        same = check.read_text(encoding="utf-8") == header
    except (OSError, UnicodeDecodeError) as error:
        raise PvidError(f"cannot read {check}: {error}") from error
    click.echo(f"{check}: {'as generated' if same else 'DIFFERENT from the output of this command'}")
    return DONE if same else DIFFERENT
