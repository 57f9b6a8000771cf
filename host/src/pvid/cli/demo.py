"""`pvid demo`: a shipped mechanism's simulated rig, identified here in both cores and streamed to a board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from pvid.base.console import write_stderr
from pvid.board.boards import BOARDS
from pvid.board.target import HOST_TARGET
from pvid.cli.input import FigurePath, force_option

BOARD = BOARDS["mps2-an386"]


@dataclass(frozen=True)
class Target:
    """Where the demo's firmware runs: a target, what it is called, and why it is not the emulated board (or None)."""

    name: str
    where: str
    lacking: str | None


def target() -> Target:
    """The emulated board where its emulator and compiler are installed, else this machine's pseudo-terminal."""
    if not BOARD.missing:
        return Target(BOARD.name, f"{BOARD.name}, {BOARD.core} in QEMU", None)
    where = "this machine, over a pseudo-terminal"
    return Target(HOST_TARGET, where, f"{BOARD.name} needs {' and '.join(BOARD.missing)}")


@click.command(name="demo")
@click.argument("model", default="kapitza")
@click.option(
    "--figure",
    type=FigurePath(),
    default=Path("pvid-demo.png"),
    help="File of the figure (png, svg, pdf).  [default: pvid-demo.png]",
)
@click.option("--seed", default=1, show_default=True, help="Seed of the sensors' noise and of the start.")
@force_option
def command(model: str, figure: Path, seed: int) -> int:
    """Simulates the rig of MODEL, streams it to the firmware on an emulated board and compares every bit.

    MODEL is a mechanism of `pvid models`; without one, that of the README.
    """
    from pvid.cli.demo_run import demo  # loads SymPy

    on = target()
    if on.lacking is not None:
        write_stderr(f"{on.lacking}: the firmware runs on {on.where}")
    return demo(model, on.name, on.where, seed, figure)
