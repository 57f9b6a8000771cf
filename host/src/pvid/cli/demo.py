"""`pvid demo`: one simulated run, identified here in both cores, streamed to a board, compared with the twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt

from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.board.boards import BOARDS
from pvid.board.stream_rig import played_samples, stream_rig
from pvid.board.target import HOST_TARGET, Verdict, verify
from pvid.cli.input import FigurePath
from pvid.cli.result import print_result, print_warning, write_figure
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import Comparison, compare_rig
from pvid.run.identify import Identification, identify
from pvid.sim.pendulum import simulate, standard_sensors, standard_start

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


@dataclass(frozen=True)
class Played:
    """A core's part of the demo: its answer, the core here against the twin, the board against the core here."""

    result: Identification
    comparison: Comparison
    verdict: Verdict

    @property
    def equal(self) -> bool:
        """In every bit, everywhere."""
        return self.comparison.equal and self.verdict.equal


def play_demo(
    on: Target,
    rigs: Sequence[RigFile],
    run: Run,
    native: Native,
    start: npt.ArrayLike,
    progress: Callable[[int], None],
) -> list[Played]:
    """Plays a run in the core of each rig file. The link is what takes long: all are streamed while the rest is done.

    Raises
    ------
    PvidError
        When the target cannot be started.
    """
    images = [stream_rig(rig, run.sample_rate, run, start) for rig in rigs]
    with ThreadPoolExecutor(len(rigs)) as pool:
        streams = [
            pool.submit(verify, on.name, image, native, *played_samples(rig, run))
            for rig, image in zip(rigs, images, strict=True)
        ]
        results, comparisons = [], []
        for number, rig in enumerate(rigs):
            results.append(identify(run, rig, native, start=start))
            before = number * len(run.t)
            comparisons.append(compare_rig(native, rig, run, start, lambda done, n=before: progress(n + done)))  # type: ignore[misc]
        verdicts = [stream.result() for stream in streams]
    return [
        Played(replace(result, on=on.name) if verdict.equal else result, comparison, verdict)
        for result, comparison, verdict in zip(results, comparisons, verdicts, strict=True)
    ]


@click.command(name="demo")
@click.argument("model", required=False)
@click.option(
    "--figure",
    type=FigurePath(),
    default=Path("pvid-demo.png"),
    help="File of the figure (png, svg, pdf).  [default: pvid-demo.png]",
)
@click.option("--seed", default=1, show_default=True, help="Seed of the sensors' noise and the start.")
@click.option("--bits", default=14, show_default=True, type=click.IntRange(8, 32), help="Resolution of the encoder.")
@click.option("--form", type=click.Choice(["weak", "strong"]), default="weak", show_default=True)
@click.option("--truth", type=click.Choice(["linear", "full"]), default="linear", show_default=True)
def command(model: str | None, figure: Path, seed: int, bits: int, form: str, truth: str) -> int:
    """Simulates the standard rig, streams it to the firmware on an emulated board and compares every bit.

    With MODEL, a mechanism of `pvid models`, it is that mechanism's rig with its own sensors.
    """
    on = target()
    if on.lacking is not None:
        write_stderr(f"{on.lacking}: the firmware runs on {on.where}")
    if model is not None:
        from pvid.cli.mechanism_demo import demo  # loads SymPy

        return demo(model, on.name, on.where, seed, figure)
    simulation = simulate(sensors=standard_sensors(bits), truth=truth, seed=seed)  # type: ignore[arg-type]
    run = simulation.run
    standard = RigFile.standard()
    rig = replace(
        standard,
        identifier=replace(standard.identifier, form=form, full_angle=truth == "full"),  # type: ignore[arg-type]
        sensor=replace(standard.sensor, phi_lsb=2 * np.pi / 2**bits),
    )
    cores = ("f32", "q31") if form == "weak" else ("f32",)  # the strong form's twins take a solve a tick
    rigs = [replace(rig, identifier=replace(rig.identifier, core=core)) for core in cores]  # type: ignore[arg-type]
    start = standard_start(seed)
    write_stderr(
        f"standard rig, {truth} equations, {bits}-bit encoder, {run.t[-1]:.0f} s at {run.sample_rate:g} Hz; "
        f"start {', '.join(f'{100 * (s / p - 1):+.0f} %' for s, p in zip(start, simulation.p, strict=True))} off"
    )
    truths = simulation.pendulum.truths
    with progress_bar(f"streaming to {on.name}, comparing with the twins", len(rigs) * len(run.t)) as advance:
        parts = play_demo(on, rigs, run, Native(), start, advance)
    for played in parts:
        print_result(played.result, rig, truths)
        print_warning(played.result)
        _print_comparison(played.comparison, f"core {played.result.core} here against its numpy twin")
        playback = played.verdict.playback
        hashed = f", hash {playback.hash:08x}" if played.verdict.equal else ""
        click.echo(f"streamed to {on.where}: {playback.done} ticks, {played.verdict.text} to here{hashed}")
    write_figure(parts[0].result, figure, truths)
    return DONE if all(played.equal for played in parts) else DIFFERENT


def _print_comparison(comparison: Comparison, label: str = "C core against the numpy twin") -> None:
    if comparison.equal:
        click.echo(f"{label}: {comparison.ticks} ticks equal in every bit, hash {comparison.twin_hash:08x}")
    else:
        click.echo(f"{label}: DIFFERENT at {comparison.difference}")
