"""`pvid log`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from pvid.base.console import DIFFERENT, DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.board.stream_image import settings_number
from pvid.board.target import EMULATORS, HOST_TARGET, open_target
from pvid.cli.log_text import record_text
from pvid.link.frames import Configuration, Source
from pvid.link.port import BAUD
from pvid.log.live_stream import live_stream
from pvid.log.mechanism import UNNAMED, LogMechanism, mechanism_described
from pvid.log.reader import Account, Observer
from pvid.log.recorder import EmulatorSource, Logger, PortSource, TextError
from pvid.log.rig import LOG_SUFFIX, refuse_to_append
from pvid.log.rig_choice import rig_of
from pvid.log.status import StatusLine
from pvid.models.registry import names
from pvid.rig.columns import parsed
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import Recording, is_run, read_recording
from pvid.settings.cores import FLOAT
from pvid.settings.forms import FORMS
from pvid.show.page import DEFAULT as LIVE_PAGE
from pvid.show.page import is_local, page
from pvid.show.view import LiveView

if TYPE_CHECKING:
    from pvid.board.mechanism_board import MechanismBoard
    from pvid.board.mechanism_board_q31 import MechanismBoardQ31
    from pvid.board.strong_board import StrongBoard
    from pvid.model.compiled import CompiledModel

    Board = MechanismBoard | MechanismBoardQ31 | StrongBoard


@click.command(name="log")
@click.argument("port")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file; copied into the log, for verify.")
@click.option("--model", help="A mechanism of `pvid models`, or a model file.  [default: that of the rig file]")
@click.option(
    "--run",
    "run_path",
    type=click.Path(path_type=Path),
    help="Recording of the mechanism: the board's design is made from it, and an emulated board's sensors read it.  "
    "[default: a simulation of the guess in the rig file]",
)
@click.option("--core", type=click.Choice(("f32", "q31")), default="f32", show_default=True, help="Arithmetic.")
@click.option(
    "--form",
    type=click.Choice(tuple(FORMS)),
    default="weak",
    show_default=True,
    help="Form of the identifier; strong: in float32, from derivatives of the signals.",
)
@click.option(
    "--refine", is_flag=True, help="The board fits the full equations behind the weak form, in float32 (pvid/refine.h)."
)
@click.option("--append", is_flag=True, help="Append to an existing log.")
@click.option("--restart", is_flag=True, help="Restart the board on every (re)connection (needs --rig).")
@click.option("--paced", is_flag=True, help="Sample as fast as the line allows instead of in real time.")
@click.option("--duration", type=click.FloatRange(min=0), help="Stop after this time [s].  [default: stop at Ctrl-C]")
@click.option("--samples", type=click.IntRange(min=1), help="Stop after this number of samples.")
@click.option(
    "--live",
    "live",
    metavar="URL",
    multiple=True,
    help="Send live data to udp://host:9870 (JSON for PlotJuggler) or teleplot://host:47269, or serve them to "
    "foxglove://host:8765; repeatable.",
)
@click.option(
    "--allow-loss",
    default=0.001,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="Share of frames or samples (0 to 1) whose loss is accepted; above it the exit code is 1.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print only the summary at the end.")
@click.option(
    "--web",
    metavar="[HOST:PORT]",
    is_flag=False,
    flag_value=LIVE_PAGE,
    help=f"Live page with moving plots for a browser; give this option after PORT and OUT.  [default: {LIVE_PAGE}]",
)
def command(
    port: str,
    out: Path,
    rig_path: Path | None,
    model: str | None,
    run_path: Path | None,
    core: str,
    form: str,
    refine: bool,
    append: bool,
    restart: bool,
    paced: bool,
    duration: float | None,
    samples: int | None,
    live: tuple[str, ...],
    allow_loss: float,
    quiet: bool,
    web: str | None,
) -> int:
    """Records all bytes that a board sends on PORT in the log OUT, until Ctrl-C.

    PORT is a serial device, a URL of pyserial or the name of an emulator. If the link fails, recording continues when
    the board is back, in a new segment of the same log. The file contains every received byte and can be read even if
    this program is killed. With a rig file, a board that waits for its settings is started.

    A board that prints lines of numbers instead, as a sketch of Arduino does, is recorded with an OUT that ends in
    .csv: the table of its rows, which `identify` reads. Its line of names is the header.

    The board's design is made for a recording, --run RUN.csv, with RUN.toml beside it by default, else for a simulation
    of the guess in the rig file, as is a shipped mechanism. With --model alone it is that of the mechanism's simulated
    rig. An emulated board's sensors read the recording or the simulation.

    On a terminal the estimates are shown as they arrive; otherwise a status line is printed every 10 s.
    """
    emulated = port in (HOST_TARGET, *EMULATORS)
    if is_run(out):
        frames_only = {
            "--rig": rig_path, "--model": model, "--run": run_path, "--core": core != "f32",
            "--form": form != "weak", "--refine": refine,
            "--append": append, "--restart": restart, "--paced": paced, "--live": live, "--web": web,
            port: emulated,
        }  # fmt: skip
        for name, given in frames_only.items():
            if given:
                raise PvidError(
                    f"{name} is for frames, whose log is named {out.with_suffix(LOG_SUFFIX)}: {out} is for text"
                )
        return record_text(port, out, duration, samples, allow_loss, quiet=quiet)
    if rig_path is None and model is None and run_path is None:
        for needed, given in (("an emulated board", emulated), ("--restart", restart), ("--refine", refine)):
            if given:
                raise PvidError(f"{needed} needs a mechanism: name it with --model, or its rig file with --rig")
    board = _board(rig_path, model, run_path, core, form, refine)
    text = None if board is None else board.text()
    if board is not None and emulated and samples is None:
        samples = len(board.recording)
    if append:
        refuse_to_append(out, text)
    source = Source.SENSOR_PACED if paced else Source.SENSOR
    begin = None if board is None else _configurations(board, source)
    mechanism = UNNAMED if board is None else _mechanism(board.rig.compiled())
    title = f"{port} -> {out}"
    with page(web, out, title) if web is not None else nullcontext("") as address:
        observers: list[Observer] = [live_stream(one, mechanism) for one in live]
        if not quiet:
            observers.append(_view(title, mechanism, address))
        logger = Logger(
            source=EmulatorSource(port, lambda: open_target(port, board)) if emulated and board else PortSource(port),
            out=out,
            observers=observers,
            rig=text,
            append=append,
            duration_s=duration,
            samples=samples,
            begin=begin,
            restart=restart,
        )
        try:
            account = logger.run()
        except TextError:
            raise
        except PvidError:
            if logger.stream.account.begun:
                print_account(logger.stream.account, 1.0, logger.failures)  # earlier data are in the log
            raise
    return print_account(account, allow_loss, logger.failures)


def _mechanism(model: CompiledModel) -> LogMechanism:
    with suppress(PvidError):  # a parameter has the name of another column: the log is recorded without views of it
        return mechanism_described(model.name, model, {one.name: one.value for one in model.knowns})
    return UNNAMED


def _view(title: str, mechanism: LogMechanism, address: str) -> Observer:
    """The live view on a terminal that can draw it, else a line every ten seconds."""
    if address and not is_local(address):
        write_stderr(f"every computer with access to this machine can open {address}")
    console = Console()
    if sys.stdout.isatty() and not console.is_dumb_terminal:
        return LiveView(console, title, mechanism, address)
    write_stderr(f"{title}; Ctrl-C ends the recording")
    if address:
        write_stderr(f"live page: {address}")
    return StatusLine(sys.stderr, mechanism)


def _board(
    rig_path: Path | None, model: str | None, run_path: Path | None, core: str, form: str, refine: bool
) -> Board | None:
    """The board of a mechanism; None: none is named."""
    if rig_path is None and model is None and run_path is None:
        return None
    from pvid.board.mechanism_board import BOARDS, MechanismBoard, board_of_guess, refuse_unrefined  # loads SymPy

    if refine:
        refuse_unrefined(core)
    if form == "strong":
        if refine or core != FLOAT.name:
            raise PvidError("--form strong is in float32 without a second stage: omit --core and --refine")
        return _strong_board(rig_path, model, run_path)
    if rig_path is None and run_path is None and model in names():
        return MechanismBoard.of_shipped_rig(model, refined=True) if refine else BOARDS[core].of_shipped_rig(model)
    rig = rig_of(run_path, rig_path, (), model)
    if run_path is None:
        return board_of_guess(rig, core, refine)
    recording = _recording(run_path, rig)
    if refine:
        return MechanismBoard.of_recording(rig, recording, refined=True)
    return BOARDS[core].of_recording(rig, recording)


def _recording(run_path: Path, rig: MechanismRig) -> Recording:
    return read_recording(run_path, rig.sample_rate, parsed(None, channels_of(rig.compiled())))


def _strong_board(rig_path: Path | None, model: str | None, run_path: Path | None) -> StrongBoard:
    from pvid.board.strong_board import StrongBoard

    if rig_path is None and run_path is None and model in names():
        return StrongBoard.of_shipped_rig(model)
    rig = rig_of(run_path, rig_path, (), model)
    return StrongBoard.of_guess(rig) if run_path is None else StrongBoard.of_recording(rig, _recording(run_path, rig))


def _configurations(board: Board, source: Source) -> Callable[[], Configuration]:
    """Makes configurations with an estimate and a hash ten times a second."""
    settings = settings_number(board)
    every = max(1, min(65535, round(board.sample_rate / 10)))
    return lambda: board.configure(settings, every, every, source)


def print_account(account: Account, allow_loss: float, failures: Sequence[str] = ()) -> int:
    """The summary of a recording, of at most 64 segments; returns the exit code.

    `failures` of the views are printed, and do not count as losses.
    """
    if earlier := account.begun - len(account.segments):
        samples = account.samples - sum(one.samples for one in account.segments)
        click.echo(f"{earlier} segments before: {samples} samples")
    for one in account.segments:
        lasted = f"{(one.ended_ns - one.began_ns) / 1e9:.1f} s, {one.why}" if one.why is not None else "not closed"
        missing = f", {one.missing_samples} missing" if one.missing_samples else ""
        click.echo(f"segment {one.number}, {one.port}: {one.samples} samples{missing}, {lasted}")
    click.echo(account.text)
    for sentence in failures:
        click.echo(f"pvid: {sentence}", err=True)
    wrong = _wrong(account)
    for sentence in wrong:
        click.echo(f"pvid: {sentence}", err=True)
    if wrong:
        return DIFFERENT
    if account.lost_share > allow_loss:
        write_stderr(f"pvid: {100 * account.lost_share:.3g} % lost, allowed are {100 * allow_loss:.3g} %")
        return DIFFERENT
    return DONE


def _wrong(account: Account) -> list[str]:
    """Faults of a recording other than counted losses; one sentence each."""
    sentences = []
    if account.garbled:
        of_them = "not one frame" if not account.frames else f"not one frame in {account.garbled} of the segments"
        where = f"{account.foreign} frames of another version that did not describe itself" if account.foreign else ""
        likely = where or f"is it the right port, and is the board's baud rate {BAUD}?"
        sentences.append(f"the received data contain {of_them}: {likely}")
    if account.unread:
        sentences.append(
            f"{account.unread} bytes arrived too fast to be decoded: they are in the log, not in this summary"
        )
    return sentences
