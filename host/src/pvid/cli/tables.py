"""`pvid tables` and `pvid schema`: C headers of the strong form and of the link, printed or checked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from pvid.base.console import DIFFERENT, DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.cases import CASES
from pvid.design.c_tables import bank_header
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.rig.file import load
from pvid.settings.forms import FORMS

_NAMES = {"strong": "strong_config", "fir": "fir_bank"}
_FIR = {"points": 241, "degree": 12, "difference": False, "stride": 1, "block": 1}


@click.command(name="tables")
@click.option(
    "--form", type=click.Choice([*FORMS, "fir"]), default="strong", show_default=True, help="Form of the tables."
)
@click.option("--core", type=click.Choice(["f32", "q31"]), help="Arithmetic.  [default: f32]")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="The rig file (TOML); strong only.")
@click.option("--name", help="Name in C.  [default: strong_config, fir_bank]")
@click.option("--check", type=click.Path(path_type=Path), help="Compare this file with the output instead of printing.")
@click.option("--points", type=int, help="fir: points of the Savitzky-Golay window, odd.  [default: 241]")
@click.option("--degree", type=int, help="fir: degree of its polynomial, 4 to 12.  [default: 12]")
@click.option("--difference", is_flag=True, default=None, help="fir: five-point central differences instead.")
@click.option("--stride", type=int, help="fir: points from tap to tap.  [default: 1]")
@click.option("--block", type=int, help="fir: samples whose mean is a point, odd.  [default: 1]")
def command(
    form: str,
    core: str | None,
    rig_path: Path | None,
    name: str | None,
    check: Path | None,
    **fir: Any,
) -> int:
    """Prints a header for the C core.

    strong: the whole configuration for init, with its tables. fir: a bank of derivative filters for a configuration of
    the strong form in float32 that is written by hand (pvid_fir_bank_f32). The weak form's are printed by `pvid model
    build`.

    For q31 the bits to spare at full scale are printed on standard error.
    """
    if form not in _NAMES:
        raise PvidError("the weak form's configuration is printed by `pvid model build kapitza --rig RIG -o FOLDER`")
    name = name or _NAMES[form]
    if form == "fir":
        if rig_path is not None:
            raise PvidError("--form fir does not depend on a rig: omit --rig")
        if core == "q31":
            raise PvidError("--form fir has float32 filters only: the fixed-point bank is part of --form strong")
        given = {key: value for key, value in fir.items() if value is not None}
        return _print_header(_fir(name, **{**_FIR, **given}), check)
    if any(value is not None for value in fir.values()):
        raise PvidError("--points, --degree, --difference, --stride and --block are for --form fir")
    if rig_path is None:
        raise PvidError(f"--form {form} needs --rig FILE")
    core = core or "f32"
    rig = load(rig_path)
    rig = replace(rig, identifier=replace(rig.identifier, form=form, core=core))  # type: ignore[arg-type]
    made_by = f"pvid tables --form {form} --core {core} --rig {rig_path.name}"
    if rig.sample_rate is None:
        raise PvidError(f"{rig_path}: sample_rate is required to compute the tables")
    case = CASES[form, core]
    config: Any = case.settings(rig, rig.sample_rate)
    for fact in case.facts(config):
        write_stderr(fact)
    return _print_header(case.header(config, rig.l1, name, f"{made_by} --name {name}"), check)


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
