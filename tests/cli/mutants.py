"""Mutated rig files, runs and command lines, and the command line that they are given to, in this process.

Whatever a user gives, a command ends with one of its exit codes; a refusal is a sentence that begins with "pvid: "; no
exception escapes, no library warns, no answer contains nan or inf, and nothing takes long. All is drawn from a seed.
"""

import contextlib
import io
import math
import random
import re
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import click
import numpy as np

from pvid.base.console import BAD_INPUT, DIFFERENT, DONE, NOTHING_IDENTIFIED
from pvid.cli import main as cli
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import Recording, write_recording
from pvid.sim.simulated_run import simulation_of, write_simulated_run

LONGEST_S = 60  # of processor time, of one command: the run is a few seconds long
_ASLEEP_S = 900  # of one command that does nothing
_NO_NUMBER = re.compile(r"(?<!['\w])(nan|inf|NaN|Infinity)(?!['\w])")  # not where a note quotes a cell
_ROWS = 3000  # of the run that is mutated


@dataclass(frozen=True)
class Outcome:
    """What a command did: `code` is None where an exception escaped, which `trace` holds."""

    code: int | None
    out: str
    err: str
    warned: tuple[str, ...]
    trace: str


class _Late(BaseException):
    """A command has not ended in time."""


def call(arguments: Sequence[str | Path]) -> Outcome:
    """Runs a command in this process, as `pvid` would in one of its own."""

    def late(signum: int, frame: FrameType | None) -> None:
        raise _Late

    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", errors="backslashreplace") for _ in range(2))
    code: int | None = None
    trace = ""
    before = sys.argv
    handlers = {number: signal.signal(number, late) for number in (signal.SIGALRM, signal.SIGPROF)}
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            sys.argv = ["pvid", *map(str, arguments)]
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                signal.alarm(_ASLEEP_S)
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
                cli.main()
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else DONE
        except _Late:
            trace = f"no end after {LONGEST_S} s"
        except BaseException:  # whatever escapes is what is looked for
            trace = traceback.format_exc()
        finally:
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_PROF, 0)
            for number, handler in handlers.items():
                signal.signal(number, handler)
            sys.argv = before
    return Outcome(code, _text(out), _text(err), tuple(str(one.message) for one in warned), trace)


def _text(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()


def complaint(outcome: Outcome) -> str | None:
    """What is wrong with an outcome; None: nothing."""
    if outcome.code is None:
        return outcome.trace.strip().splitlines()[-1]
    if outcome.warned:
        return f"warning: {outcome.warned[0]}"
    if outcome.code not in (DONE, DIFFERENT, BAD_INPUT, NOTHING_IDENTIFIED):
        return f"exit code {outcome.code}"
    lines = outcome.err.splitlines()
    if outcome.code == BAD_INPUT and not (lines and lines[-1].startswith("pvid: ")):
        return f"a refusal without its sentence: {outcome.err[-200:]!r}"
    if outcome.code == DONE and _NO_NUMBER.search(outcome.out):
        return f"no number: {outcome.out[-200:]!r}"
    return None


@dataclass(frozen=True)
class Subject:
    """A mechanism whose run is in run.csv, and its rig file beside it in run.toml."""

    model: CompiledModel
    recording: Recording


def written_subject(name: str, seed: int) -> Subject:
    """Writes the start of a run of a shipped rig and its rig file into the present folder."""
    simulation = simulation_of(name)
    run = {key: x[:_ROWS] for key, x in simulation.run(seed).items()}
    write_simulated_run(Path("run.csv"), run, simulation)
    t = run.pop("t")
    return Subject(compiled_of(name), Recording(t, run, simulation.rig.sample_rate))


def of_rigs(draw: random.Random, subject: Subject) -> Iterator[list[str]]:
    """Commands, each behind another rig file."""
    commands = (
        ["design", "--rig", "rig.toml", "--duration", "4"],
        *(["identify", "run.csv", "--rig", "rig.toml", *more] for more in ([], ["--json"], ["--core", "q31"])),
    )
    while True:
        Path("rig.toml").write_bytes(rig_text(draw, subject.model))
        yield list(draw.choice(commands))


def of_runs(draw: random.Random, subject: Subject) -> Iterator[list[str]]:
    """Commands, each behind another run."""
    originals = written_runs(subject, Path())
    while True:
        suffix = ".csv" if draw.random() < 0.5 else draw.choice(list(originals))
        distorted = suffix == ".csv" and draw.random() < 0.8
        mutant = distorted_run(subject.recording, draw) if distorted else mutated_run(originals[suffix], draw)
        Path(f"mutant{suffix}").write_bytes(mutant)
        looked = ["look", f"mutant{suffix}"]
        yield looked if draw.random() < _LOOKED_AT else ["identify", f"mutant{suffix}", "--rig", "run.toml", "--json"]


def of_command_lines(draw: random.Random, _: Subject) -> Iterator[list[str]]:
    """What they wrote is removed."""
    while True:
        yield command_line(draw)
        for path in Path().iterdir():
            if path.name not in ("run.csv", "run.toml") and path.is_file():
                path.unlink()


# ---- rig files and runs

# Values that no key expects.
_ODD = (
    *("0", "-0.0", "1", "-1", "nan", "-nan", "inf", "-inf", "1e-300", "5e-324", "1e308", "1e-6", "1e6", "1e12", "0.5"),
    *("2", "3", "12", "16", "1000", "65535", "65536", "2147483648", "9007199254740993", "1e-3", "1e3", "0.999"),
    *("'weak'", "'q31'", "true", "false", "[]", "{}", "[1,2]", "{a=1}", "1979-05-27", "07:32:00", "'\\u0000'"),
    *('"\\u202e\\u001b[31m"', "0x7fffffff", "1_000", "''"),
)
_CSV_BYTES = b",;\n\r\t\"' .-+eE0123456789naif\x00\xff"
_SUFFIXES = (".csv", ".csv.gz", ".npz", ".parquet")
_APPENDED = ("[sensor]\n", "l1=2\n", "[[identifier]]\n", "x.y.z=1\n", "\ufeff", "[identifier.window_s]\na=1\n")
_OF_SENSOR = ("resolution", "noise", "reach", "gain_sd", "delay", "neglected")
_OF_IDENTIFIER = ("forgetting_s", "outlier_gate", "outlier_patience_s", "kappa_min", "dead_zone", "renewal")


def rig_text(draw: random.Random, model: CompiledModel) -> bytes:
    """A rig file of a mechanism whose keys have usual values, values far from them and odd ones; some are not TOML."""
    usual = {
        "": {"sample_rate": 400.0, "clock_sd": 1e-4},
        "known": {one.name: one.value for one in model.knowns},
        "known_sd": {one.name: one.sd for one in model.knowns},
        "nominal": {one.name: one.guess or one.sd for one in model.unknowns},
        "identifier": dict.fromkeys(_OF_IDENTIFIER, 1.0),
        **{f"sensor.{one.name}": dict.fromkeys(_OF_SENSOR, one.resolution or 1.0) for one in model.signals},
    }
    lines = ["[model]", f"name = {model.name!r}"]
    for table, keys in usual.items():
        chosen = draw.sample(list(keys), draw.randint(0, min(len(keys), draw.choice((0, 1, 1, 2, 3)))))
        own = [f"{key} = {_value(keys[key], draw)}" for key in chosen]
        lines = [*lines, f"[{table}]", *own] if table else [*own, *lines]
    text = "\n".join(lines) + "\n"
    kind = draw.random()
    if kind < 0.04:
        noisy = bytearray(text.encode())
        for _ in range(draw.randint(1, 5)):
            noisy[draw.randrange(len(noisy))] = draw.randrange(256)
        return bytes(noisy)
    return (text + draw.choice(_APPENDED) if kind < 0.06 else text).encode()


def _value(usual: float, draw: random.Random) -> str:
    kind = draw.random()
    if kind < 0.2:
        return draw.choice(_ODD)
    return repr(
        usual * 10 ** draw.uniform(-1, 1) if kind < 0.6 else draw.choice((-1, 1, 1)) * 10 ** draw.uniform(-9, 5)
    )


def written_runs(subject: Subject, folder: Path) -> dict[str, bytes]:
    """The run in each format, by suffix."""
    found = {}
    for suffix in _SUFFIXES:
        path = folder / f"original{suffix}"
        write_recording(path, subject.recording, channels_of(subject.model))
        found[suffix] = path.read_bytes()
        path.unlink()
    return found


def distorted_run(recording: Recording, draw: random.Random) -> bytes:
    """CSV of a run whose signals are what other rigs, other units and broken sensors make of them."""
    signals = {"t": recording.t.copy(), **{name: x.copy() for name, x in recording.signals.items()}}
    count = len(recording.t)
    for _ in range(draw.choice((1, 1, 2, 3))):
        data = signals[draw.choice(list(signals))]
        first = draw.randrange(count)
        part = slice(first, min(count, first + draw.choice((1, 2, 50, count))))
        size = draw.choice((1.0, -1.0)) * 10 ** draw.choice((0, 1, 3, 6, -3, -9, draw.uniform(-320, 300)))
        with np.errstate(all="ignore"):
            kind = draw.randrange(8)
            if kind == 0:
                data *= size
            elif kind == 1:
                data += size
            elif kind == 2:
                data[part] = size
            elif kind == 3:
                data[part] = draw.choice((math.nan, math.inf, -math.inf, 0.0))
            elif kind == 4:
                data[:] = data[::-1].copy()
            elif kind == 5:
                data[:] = np.round(data / size) * size
            elif kind == 6:
                data[:] = signals[draw.choice(list(signals))]
            else:
                data += size * np.random.default_rng(draw.randrange(1 << 30)).standard_normal(count)
    rows = zip(*(map(repr, one.tolist()) for one in signals.values()), strict=True)
    return "\n".join([",".join(signals), *map(",".join, rows), ""]).encode()


def mutated_run(original: bytes, draw: random.Random) -> bytes:
    """With bytes changed, dropped, doubled or put in, anywhere or near the ends, where formats have their tables."""
    data = bytearray(original)
    for _ in range(draw.choice((1, 1, 2, 5, 50))):
        near = min(600, len(data))
        where = draw.random()
        at = draw.randrange(len(data) if where < 0.5 else near)
        if where > 0.75:
            at = len(data) - 1 - at
        kind = draw.random()
        if kind < 0.5:
            data[at] = draw.randrange(256)
        elif kind < 0.6:
            del data[at : at + draw.randint(1, 20)]
        elif kind < 0.7:
            data[at:at] = bytes(draw.choices(_CSV_BYTES, k=draw.randint(1, 9)))
        elif kind < 0.75:
            del data[at + 1 :]
        elif kind < 0.8:
            data[at:at] = data[at : at + draw.randint(1, 400)]
        else:
            data[at] ^= 1 << draw.randrange(8)
        data = data or bytearray(b"x")
    return bytes(data)


# ---- command lines

_NUMBERS = (
    *("0", "-0", "1", "-1", "nan", "-inf", "inf", "1e300", "-1e300", "1e-300", "5e-324", "1e9", "1e-9", "3", "0.3"),
    *("1000000000000001", "99999999999999999999999", "1.5", "abc", "", "0x10", "1_000", "٣", " 2 ", "1e", "--"),
)
_NAMES = (
    *("run.csv", "run.toml", "", ".", "..", "/", "/dev/null", "/dev/full", "/proc/x.csv", "/nonexistent/x.csv"),
    *("[/b].csv", "[red].csv", "a b.csv", "q'uo\"te.csv", "new\nline.csv", "ünï-漢字.csv", "-dash.csv", "$a$.csv"),
    *("\x1b[31mred.csv", "%s%n.csv", "a" * 251 + ".csv", "a" * 300 + ".csv", "out.csv", "out.csv.gz", "out.npz"),
    *("out.parquet", "out.toml", "out.png", "out.pgf", "out", "bad\udcff.csv", "x.pvlog", "out.csv/", "\u202egpj.csv"),
)
_HOSTS = (
    *("a..b:80", "é" * 70 + ":80", "[::1", ":", "127.0.0.1:99999", "0.0.0.0:-1", "host", "", "[]:0", "1.2.3.4.5:80"),
    *("http://x", "udp://", "udp://a..b:80", "udp://" + "é" * 70 + ":80", "udp://[::1", "udp://x:0", "teleplot://:"),
)
_PORTS = (
    *("hwgrep://(", "hwgrep://", "socket://:", "socket://a..b:1", "socket://127.0.0.1:1", "spy:///dev/null", "loop:/"),
    *("alt://x?class=zz", "foo://x", "cp2110://x", "rfc2217://127.0.0.1:1", "rfc2217://?", "/dev/null", "/tmp", ""),
    *("run.csv", "/dev/nonexistent", "\x1b[31m", "socket://?logging=x", "rfc2217://x?poll_modem=("),
)
_SETTINGS = (
    *("known.l1=0.3", "known.l1=nan", "l1=", "=", "l1", "x=1", "sensor.phi.resolution=1e-300", "a.b.c=1", "l1=[[[["),
    *("sample_rate=1e-3", "sample_rate=1e6", 'l1="""', "identifier.forgetting_s=1e300", "nominal.k=0"),
)
_COLUMNS = (
    *("t=1,phi=2,i=3", "phi=phi:deg", "phi=phi:rev/0", "t=t:1e300", "t=t:1e-300", "y=-y", "y=y:-mm", "t", "=", "a=b=c"),
    *("t=99", "t=0", "phi=y,y=phi", "phi=t", "t=phi", "t=t:nan", "t=t:inf", "phi=phi:", "", "y=y:um,y=y:mm"),
)
_LOOKED_AT = 0.3  # of the runs
# Commands that neither record nor emulate, and end by themselves.
_TRIED = (
    *("identify", "validate", "compare", "tune", "plot", "design", "tables", "models", "schema", "verify", "export"),
    *("look", "layout", "model check", "model predict", "model simulate", "log"),
)
_WORDS = {"--columns": _COLUMNS, "--set": _SETTINGS, "--web": _HOSTS, "--live": _HOSTS, "--on": _PORTS}
_GOOD = {"--rig": "run.toml", "--run": "run.csv", "--duration": "3"}


def _command(name: str) -> click.Command:
    found: click.Command = cli.commands
    for word in name.split():
        assert isinstance(found, click.Group)
        own = found.get_command(click.Context(found), word)
        assert own is not None, name
        found = own
    return found


def _words_of(option: click.Parameter) -> tuple[str, ...]:
    """What an option or argument is given."""
    if isinstance(option.type, click.Choice):
        return (*map(str, option.type.choices), "nope", "")
    if isinstance(option.type, click.types.FloatParamType | click.types.IntParamType):
        return _NUMBERS
    named = next((one for one in option.opts if one in _WORDS), "")
    return _WORDS.get(named, _NAMES)


def command_line(draw: random.Random) -> list[str]:
    """One that is right but for a few of its words; the options are those that the command has."""
    name = draw.choice((*_TRIED, "nope", ""))
    if name in ("nope", ""):
        return [name, *draw.choices(_NAMES, k=draw.randint(0, 2))]
    command = _command(name)
    line, records = name.split(), name == "log"
    for one in command.params:
        if isinstance(one, click.Argument):
            right = draw.random() < 0.6 and not records
            good = "out.csv" if one.name == "out" else "dc_motor" if name.startswith("model") else "run.csv"
            line.append(good if right else draw.choice(_PORTS if records else _NAMES))
    line += ["--duration", "0.05"] if records else []
    options = [one for one in command.params if isinstance(one, click.Option) and one.opts[0] != "--duration"]
    for option in draw.sample(options, min(len(options), draw.choice((0, 1, 1, 2, 3)))):
        line.append(option.opts[-1])
        if not option.is_flag:
            usual = _GOOD.get(option.opts[-1])
            line.append(usual if usual and draw.random() < 0.4 else draw.choice(_words_of(option)))
    if draw.random() < 0.03:
        line.append(draw.choice((*_NUMBERS, *_NAMES, "--nope", "-h", "--version")))
    return line
