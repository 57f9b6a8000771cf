"""The commands for boards in the field: log, verify, export, plot."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

import click
from rich.console import Console

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.board.stream_image import settings_number
from pvid.board.stream_rig import StreamRig, stream_rig
from pvid.board.target import EMULATORS, HOST_TARGET, open_target
from pvid.cli.input import FigurePath, columns_option, print_notes, rig_options
from pvid.link.frames import Configuration, Source
from pvid.link.port import BAUD
from pvid.log.live_stream import Tee
from pvid.log.reader import Account, LogReader, Observer
from pvid.log.recorder import EmulatorSource, Logger, PortSource
from pvid.log.rig import refuse_to_append, rig_of_log
from pvid.log.rig_settings import rig_for
from pvid.log.status import StatusLine
from pvid.log.values import UNKNOWN_RIG
from pvid.models.model import Mechanism
from pvid.rig.columns import Columns
from pvid.rig.file import RigFile, load
from pvid.show.page import DEFAULT as LIVE_PAGE
from pvid.show.page import is_local, page
from pvid.show.view import LiveView


@click.command(name="log")
@click.argument("port")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file; copied into the log, for verify.")
@click.option("--append", is_flag=True, help="OUT may exist: new segments are appended to it.")
@click.option("--anew", is_flag=True, help="Start a new session whenever the link comes up (needs --rig).")
@click.option("--paced", is_flag=True, help="The started board samples as fast as the line allows, not in real time.")
@click.option("--duration", type=click.FloatRange(min=0), help="Stop after this time [s].  [default: at Ctrl-C]")
@click.option("--samples", type=click.IntRange(min=1), help="Stop after this number of samples.")
@click.option(
    "--tee",
    "tees",
    metavar="URL",
    multiple=True,
    help="Also send to udp://host:9870 (JSON: PlotJuggler) or teleplot://host:47269; repeatable.",
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
def log_command(
    port: str,
    out: Path,
    rig_path: Path | None,
    append: bool,
    anew: bool,
    paced: bool,
    duration: float | None,
    samples: int | None,
    tees: tuple[str, ...],
    allow_loss: float,
    quiet: bool,
    web: str | None,
) -> int:
    """Records all bytes that a board sends on PORT in the log OUT, until Ctrl-C.

    PORT is a serial device, a URL of pyserial or the name of an emulator. If the link fails, recording continues when
    the board is back, in a new segment of the same log. The file contains every received byte and can be read even if
    this program is killed. With a rig file, a board that waits for its settings is started.

    On a terminal the estimates are shown as they arrive; otherwise a status line is printed every 10 s.
    """
    emulated = port in (HOST_TARGET, *EMULATORS)
    rig = None if rig_path is None else load(rig_path)
    if emulated and rig is None:
        rig = RigFile.standard()
    if anew and rig is None:
        raise PvidError("--anew needs --rig: the board starts over with its settings")
    if append:
        refuse_to_append(out, rig)
    board = None if rig is None else _board(rig)
    source = Source.SENSOR_PACED if paced else Source.SENSOR
    begin = None if board is None else _configurations(board, source)
    mechanism = UNKNOWN_RIG if rig is None else rig.mechanism
    title = f"{port} -> {out}"
    with page(web, out, title) if web is not None else nullcontext("") as address:
        observers: list[Observer] = [Tee(one, mechanism) for one in tees]
        if not quiet:
            observers.append(_view(title, mechanism, address))
        logger = Logger(
            source=EmulatorSource(port, lambda: open_target(port, board)) if emulated and board else PortSource(port),
            out=out,
            observers=observers,
            rig=None if rig is None else rig.text(),
            append=append,
            duration_s=duration,
            samples=samples,
            begin=begin,
            anew=anew,
        )
        try:
            account = logger.run()
        except PvidError:
            if logger.stream.account.begun:
                print_account(logger.stream.account, 1.0, logger.failures)  # earlier data are in the log
            raise
    return print_account(account, allow_loss, logger.failures)


def _view(title: str, mechanism: Mechanism, address: str) -> Observer:
    """The live view on a terminal that can draw it, else a line every ten seconds."""
    if address and not is_local(address):
        write_stderr(f"every computer that can reach this machine can open {address}")
    console = Console()
    if sys.stdout.isatty() and not console.is_dumb_terminal:
        return LiveView(console, title, mechanism, address)
    write_stderr(f"{title}; Ctrl-C ends the recording")
    if address:
        write_stderr(f"live page: {address}")
    return StatusLine(sys.stderr, mechanism.model)


def _board(rig: RigFile) -> StreamRig:
    if rig.sample_rate is None:
        raise PvidError("the rig file has no sample_rate, and a board that samples by itself needs one")
    return stream_rig(rig, rig.sample_rate)


def _configurations(board: StreamRig, source: Source) -> Callable[[], Configuration]:
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
        write_stderr(f"pvid: {100 * account.lost_share:.3g} % lost, {100 * allow_loss:.3g} % are allowed")
        return DIFFERENT
    return DONE


def _wrong(account: Account) -> list[str]:
    """Faults of a recording other than counted losses; one sentence each."""
    sentences = []
    if account.garbled:
        of_them = "not one frame" if not account.frames else f"not one frame in {account.garbled} of the segments"
        where = f"{account.foreign} frames of another version that did not describe itself" if account.foreign else ""
        likely = where or f"is it the right port, and is the board's baud rate {BAUD}?"
        sentences.append(f"what came from the board holds {of_them}: {likely}")
    if account.unread:
        sentences.append(
            f"{account.unread} bytes came faster than they could be decoded: they are in the log, not in this account"
        )
    return sentences


_MOST_STRETCHES = 100  # that are printed

_LOG = click.argument("log", type=click.Path(path_type=Path))
_RIG = click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file.  [default: the log's own]")


@click.command(name="verify")
@_LOG
@_RIG
@click.option("--partial", is_flag=True, help="Exit code 0 also if only a part is verified.")
def verify_command(log: Path, rig_path: Path | None, partial: bool) -> int:
    """Computes a whole LOG again with the numpy twin and compares every estimate and hash, bit for bit.

    Prints the first difference. A sample is verified if an equal hash covers it. Samples after a lost sample cannot
    be verified until the board begins another session; they are listed, and counted in the summary.

    Exit code 0: every sample is verified; those after the last hash may be unverified if no further hash was due.
    1: there is a difference, or, without --partial, other samples are not verified. 3: no sample is verified.
    """
    from pvid.log.verify import Verdict, Verifier  # the twins, which other commands do not need

    rig = load(rig_path) if rig_path is not None else rig_of_log(log)
    reader = LogReader(log)
    verdict = Verdict()
    with progress_bar("verifying", None) as advance:
        for stretch in Verifier(rig, advance).stretches(reader):
            if verdict.stretches < _MOST_STRETCHES or stretch.difference is not None:
                click.echo(stretch.text)
            verdict.add(stretch)
    if (more := verdict.stretches - _MOST_STRETCHES) > 0:
        click.echo(f"{more} stretches more, named here where they are DIFFERENT")
    click.echo(verdict.text)
    click.echo(reader.account.text)
    if verdict.different:
        return DIFFERENT
    if not verdict.verified:
        return NOTHING_IDENTIFIED
    return DONE if partial or not verdict.left else DIFFERENT


@click.command(name="export")
@_LOG
@_RIG
@click.option("--to", "form", type=click.Choice(["csv", "parquet", "mcap", "npz"]), required=True, help="Format.")
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Output without extension.  [default: beside LOG]")
def export_command(log: Path, rig_path: Path | None, form: str, out: Path | None) -> int:
    """Writes samples, estimates, status and events of a LOG in SI units, for other programs.

    csv and parquet write one file for each table; units are in LOG-metadata.json (CSV on the Web) or in the columns'
    metadata. npz is one file; its arrays t, phi and y are a run for `pvid identify` if no sample is missing; the units
    are in its array "units". mcap is one file of JSON messages for PlotJuggler and Foxglove.
    """
    from pvid.log.export import export_log

    rig = load(rig_path) if rig_path is not None else rig_of_log(log)
    for path in export_log(log, form, out or log.with_suffix(""), UNKNOWN_RIG if rig is None else rig.mechanism):
        click.echo(path)
    return DONE


@click.command(name="plot")
@click.argument("log", metavar="LOG|RUN", type=click.Path(path_type=Path))
@rig_options
@columns_option
@click.option("-o", "--out", type=FigurePath(), help="png, svg or pdf.  [default: LOG with .png]")
def plot_command(
    log: Path, rig_path: Path | None, settings: tuple[str, ...], columns: Columns | None, out: Path | None
) -> int:
    """Draws a report of a LOG: convergence, residuals and their autocorrelation, spectra, phase plot.

    A run (.csv, .npz, .parquet, ...), or a log without estimates, is identified on this machine first.
    """
    from pvid.show.report import recording_of, write_report  # matplotlib and scipy, which other commands do not need

    recording = recording_of(log, rig_for(log, rig_path, settings), columns)
    print_notes(recording.run.notes)
    out = out or log.with_suffix(".png")
    write_report(recording, out)
    click.echo(out)
    return DONE


COMMANDS = (log_command, verify_command, export_command, plot_command)
