"""`pvid tables` and `pvid schema`: C headers, printed or checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import click

from pvid.base.console import DIFFERENT, DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.cases import CASES, Case
from pvid.cli.input import read_input, with_overrides
from pvid.design.c_tables import bank_header
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.design.weak import to_c_header
from pvid.design.weak_sizing import raised_bounds
from pvid.rig.file import RigFile, load
from pvid.rig.run import Run
from pvid.settings.forms import FORMS
from pvid.settings.tables import WeakSizes
from pvid.setup.f32 import weak_design_of

_FIR = {"points": 241, "degree": 12, "difference": False, "stride": 1}


@click.command(name="tables")
@click.option(
    "--form", type=click.Choice([*FORMS, "fir"]), default="weak", show_default=True, help="Form of the tables."
)
@click.option("--core", type=click.Choice(["f32", "q31"]), help="Arithmetic.  [default: f32; strong: q31]")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="The rig file (TOML); weak and strong only.")
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="Size the weak tables for this recorded run.")
@click.option("--name", help="Name in C.  [default: weak_tables, strong_config, fir_bank]")
@click.option("--check", type=click.Path(path_type=Path), help="Compare this file with the output instead of printing.")
@click.option("--points", type=int, help="fir: points of the Savitzky-Golay window, odd.  [default: 241]")
@click.option("--degree", type=int, help="fir: degree of its polynomial, 4 to 12.  [default: 12]")
@click.option("--difference", is_flag=True, default=None, help="fir: five-point central differences instead.")
@click.option("--stride", type=int, help="fir: samples between points.  [default: 1]")
def command(
    form: str,
    core: str | None,
    rig_path: Path | None,
    run_path: Path | None,
    name: str | None,
    check: Path | None,
    **fir: Any,
) -> int:
    """Prints the constant tables of the C core as a header.

    weak, f32: the design for pvid_weak_config_f32. weak, q31: the whole configuration for pvid_weak_init_q31. strong,
    q31: the whole configuration for pvid_strong_init_q31. fir: a bank of derivative filters for the strong form in
    float32 (pvid_fir_bank_f32).

    The sizes of the weak tables follow the modes of the rig file's guess, or with --run the modes of a recorded run, as
    in identify. For q31 the bits to spare at full scale are printed on standard error.
    """
    cores = [known for of, known in _KINDS if of == form]
    core = core or cores[0]
    if (form, core) not in _KINDS:
        hint = "its weights are a bank of filters: use --form fir" if form in FORMS else "use --core f32"
        raise PvidError(f"no tables for --form {form} --core {core}: {hint}")
    kind = _KINDS[form, core]
    name = name or kind.name
    if kind.text is None:
        if rig_path is not None or run_path is not None:
            raise PvidError("--form fir does not depend on a rig: omit --rig and --run")
        given = {key: value for key, value in fir.items() if value is not None}
        return _print_header(_fir(name, **{**_FIR, **given}), check)
    if any(value is not None for value in fir.values()):
        raise PvidError("--points, --degree, --difference and --stride are for --form fir")
    if rig_path is None:
        raise PvidError(f"--form {form} needs --rig FILE")
    rig, run = with_overrides(load(rig_path), form=form), None
    made_by = f"pvid tables --form {form} --core {core} --rig {rig_path.name}"
    if run_path is not None:
        if not rig.identifier.form_traits.uses_windows:
            raise PvidError("--run is for --form weak")
        from pvid.run.survey import fitted

        run = read_input(run_path, rig)
        rig = replace(fitted(rig, run), sample_rate=run.sample_rate)
        made_by += f" --run {run_path.name}"
    if rig.sample_rate is None:
        raise PvidError(f"{rig_path}: sample_rate is required to compute the tables")
    return _print_header(kind.text(CASES[form, core], rig, run, name, f"{made_by} --name {name}"), check)


@click.command(name="schema")
def schema() -> int:
    """Prints firmware/link/schema.h: the layouts of the frames of the serial link."""
    from pvid.link.frames import c_header

    click.echo(c_header(), nl=False)
    return DONE


def _fir(name: str, points: int, degree: int, difference: bool, stride: int) -> str:
    bank = finite_difference(stride) if difference else savitzky_golay(points, degree, stride)
    kind = "--difference" if difference else f"--points {points} --degree {degree}"
    return bank_header(bank, name, f"pvid tables --form fir {kind} --stride {stride} --name {name}")


def _weak_design(case: Case, rig: RigFile, run: Run | None, name: str, made_by: str) -> str:
    """The tables of the weak form in float32."""
    tables = weak_design_of(rig, rig.sample_rate or 0.0)
    write_stderr(
        f"taps {tables.taps}, decimation {tables.decimation}, windows of {tables.window} samples "
        f"({tables.window_s:g} s), {tables.functions} test functions; {tables.flash_bytes} bytes of flash; "
        f"{tables.update_rate_hz:.2f} estimates per second"
    )
    _print_raised(tables)
    return to_c_header(tables, name, made_by)


def _configuration(case: Case, rig: RigFile, run: Run | None, name: str, made_by: str) -> str:
    """The whole configuration in fixed point."""
    config: Any = case.settings(rig, rig.sample_rate or 0.0) if run is None else case.settings_for_run(rig, run)
    _print_margins(config.design.margins)
    if rig.identifier.form_traits.uses_windows:
        _print_raised(config.design)
    return case.header(config, rig.l1, name, made_by)


class _Kind(NamedTuple):
    """A header: its default name in C and what makes it from a rig; None: no rig does."""

    name: str
    text: Callable[[Case, RigFile, Run | None, str, str], str] | None


_KINDS = {
    ("weak", "f32"): _Kind("weak_tables", _weak_design),
    ("weak", "q31"): _Kind("weak_tables", _configuration),
    ("strong", "q31"): _Kind("strong_config", _configuration),
    ("fir", "f32"): _Kind("fir_bank", None),
}


def _print_margins(margins: dict[str, float]) -> None:
    write_stderr(f"bits to spare at full scale: {', '.join(f'{name} {bits:.2f}' for name, bits in margins.items())}")


def _print_raised(design: WeakSizes) -> None:
    """Prints the macros of pvid/config.h whose defaults the design exceeds."""
    raised = [f"-D{macro}={value}" for macro, value in raised_bounds(design).items()]
    if raised:
        write_stderr(f"build the core with {' '.join(raised)}")


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
