"""`pvid tables` and `pvid schema`: C headers, printed or checked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from pvid.base.console import DIFFERENT, DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.input import read_input, with_overrides
from pvid.design.c_tables import bank_header
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.design.weak import to_c_header
from pvid.design.weak_sizing import SizesOfDesign, raised_bounds
from pvid.rig.file import RigFile, load
from pvid.settings.q31 import WeakConfigQ31
from pvid.setup.f32 import weak_design_of
from pvid.setup.q31 import config_for_run, strong_config_q31, weak_config_q31
from pvid.setup.strong_header_q31 import strong_header_q31
from pvid.setup.weak_header_q31 import to_c_header_q31

_CORES = {"weak": ("f32", "q31"), "strong": ("q31",), "fir": ("f32",)}
_NAMES = {"weak": "weak_tables", "strong": "strong_config", "fir": "fir_bank"}
_FIR = {"points": 241, "degree": 12, "difference": False, "stride": 1}


@click.command(name="tables")
@click.option("--form", type=click.Choice(list(_CORES)), default="weak", show_default=True, help="Form of the tables.")
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
    core = core or _CORES[form][0]
    if core not in _CORES[form]:
        hint = "its weights are a bank of filters: use --form fir" if form == "strong" else "use --core f32"
        raise PvidError(f"no tables for --form {form} --core {core}: {hint}")
    name = name or _NAMES[form]
    if form == "fir":
        if rig_path is not None or run_path is not None:
            raise PvidError("--form fir does not depend on a rig: omit --rig and --run")
        given = {key: value for key, value in fir.items() if value is not None}
        return _print_header(_fir(name, **{**_FIR, **given}), check)
    if any(value is not None for value in fir.values()):
        raise PvidError("--points, --degree, --difference and --stride are for --form fir")
    if rig_path is None:
        raise PvidError(f"--form {form} needs --rig FILE")
    if form == "strong":
        if run_path is not None:
            raise PvidError("--run is for --form weak")
        return _print_header(_strong(rig_path, name), check)
    return _print_header(_weak(rig_path, run_path, core, name), check)


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


def _weak(rig_path: Path, run_path: Path | None, core: str, name: str) -> str:
    rig = with_overrides(load(rig_path), form="weak")
    made_by = f"pvid tables --form weak --core {core} --rig {rig_path.name}"
    run = None
    if run_path is not None:
        from pvid.run.survey import fitted

        run = read_input(run_path, rig)
        rig = replace(fitted(rig, run), sample_rate=run.sample_rate)
        made_by += f" --run {run_path.name}"
    made_by += f" --name {name}"
    rate = _sample_rate(rig, rig_path)
    if core == "q31":
        config = weak_config_q31(rig, rate) if run is None else config_for_run(rig, run)
        assert isinstance(config, WeakConfigQ31)  # by the form
        _print_margins(config.design.margins)
        _print_raised(config.design)
        return to_c_header_q31(config, rig.l1, name, made_by)
    tables = weak_design_of(rig, rate)
    write_stderr(
        f"taps {tables.taps}, decimation {tables.decimation}, windows of {tables.window} samples "
        f"({tables.window_s:g} s), {tables.functions} test functions; {tables.flash_bytes} bytes of flash; "
        f"{tables.update_rate_hz:.2f} estimates per second"
    )
    _print_raised(tables)
    return to_c_header(tables, name, made_by)


def _strong(rig_path: Path, name: str) -> str:
    rig = load(rig_path)
    config = strong_config_q31(rig, _sample_rate(rig, rig_path))
    _print_margins(config.design.margins)
    made_by = f"pvid tables --form strong --core q31 --rig {rig_path.name} --name {name}"
    return strong_header_q31(config, rig.l1, name, made_by)


def _sample_rate(rig: RigFile, path: Path) -> float:
    if rig.sample_rate is None:
        raise PvidError(f"{path}: sample_rate is required to compute the tables")
    return rig.sample_rate


def _print_margins(margins: dict[str, float]) -> None:
    write_stderr(f"bits to spare at full scale: {', '.join(f'{name} {bits:.2f}' for name, bits in margins.items())}")


def _print_raised(design: SizesOfDesign) -> None:
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
