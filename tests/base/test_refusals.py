"""Sentences of refusals: each is in a test, here where in no other, but for those that a fault of a machine gives."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from mcap.writer import Writer

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.cli import batch, sizes, tables
from pvid.cli import design as design_command
from pvid.configuration.excitation import _refuse_missing
from pvid.configuration.weak_formats_q31 import gate_config_q31
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.fleet.store import Store
from pvid.link.frames import encode_raw, parse_schema
from pvid.link.names import BoardNames
from pvid.log.reader import LogReader
from pvid.model import Model
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.filters import compensator
from pvid.oracle.weak.identify import ready, start_of
from pvid.oracle.weak.scores import between
from pvid.rig.columns import Channel, Columns
from pvid.rig.mechanism_file import parsed_file
from pvid.rig.run import read_recording, recording_of_arrays
from pvid.settings.parts import GateConfig

SOURCES = Path(__file__).parents[2] / "host/src/pvid"
TESTS = Path(__file__).parents[1]
COLUMNS = Columns((Channel("F", "N"), Channel("x", "m")))
ROWS = "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(50))


def _read(text: str | bytes, columns: str | None = None) -> Callable[[Path], Any]:
    def read(folder: Path) -> None:
        path = folder / "run.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        read_recording(path, None, COLUMNS if columns is None else Columns.parse(columns, COLUMNS.channels))

    return read


def _rows(many: int) -> Any:
    """A record of one term with so many windows."""
    channels = SimpleNamespace(rows=[SimpleNamespace(terms=[None])])
    grid = SimpleNamespace(design=SimpleNamespace(test_functions=None))
    return SimpleNamespace(channels=channels, grid=grid, rows=lambda *_: np.zeros(many))


def _other_topic(folder: Path) -> None:
    path = folder / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("one", "jsonschema", b"{}")
        for topic, name in (("/a", "F"), ("/b", "x")):
            channel = writer.register_channel(topic, "json", schema)
            for k in range(20):
                writer.add_message(channel, k * 10**7, f'{{"{name}": {k}}}'.encode(), k * 10**7)
        writer.finish()  # type: ignore[no-untyped-call]
    read_recording(path, None, Columns.parse("F=F,x=4", COLUMNS.channels))


def _no_messages(folder: Path) -> None:
    path = folder / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    read_recording(path, None, COLUMNS)


def _cart() -> Model:
    model = Model("cart")
    F, x = model.input("F", "N", hold="zoh"), model.sensor("x", "m", resolution=1e-5)
    model.equation(model.unknown("m", "kg", 1) * x.d(2) - F)
    return model


def _own_apart(_: Path) -> None:
    found = CliRunner().invoke(batch.command, ["--own", "R", "--model", "dc_motor", "-o", "a.parquet", __file__])
    assert found.exception is not None, found.output
    raise found.exception


def _path(text: bytes) -> Callable[[Path], Any]:
    def read(folder: Path) -> None:
        (folder / "a.toml").write_bytes(text)
        parsed_file(folder / "a.toml", toml_document)

    return read


CASES: dict[str, Callable[[Path], Any]] = {
    "'1,2' is not AMPLITUDE,FREQUENCY_HZ,PHASE_RAD": lambda _: design_command._tone("1,2"),
    "'1,-2,0' needs finite numbers and a frequency >= 0": lambda _: design_command._tone("1,-2,0"),
    "--core is for --model: without it both are measured": lambda _: _sizes(core="f32"),
    "--profile has no budget: omit --budget and --check": lambda _: _sizes(profiled="mps2-an386", budget=Path("b")),
    "measure every board: name no TARGET and no --model": lambda _: _sizes(budget=Path("b"), targets=("qemu",)),
    "--block is for Savitzky-Golay windows: omit it or --difference": lambda _: tables._fir("a", 5, 4, True, 1, 3),
    "outlier_patience_s = 1e+12 is too long for core q31": lambda _: gate_config_q31(GateConfig(patience_s=1e12), 1e3),
    "a Savitzky-Golay polynomial must have degree 4 to": lambda _: savitzky_golay(11, 3),
    "the stride of a differentiator must be 1 sample or more, not 0": lambda _: finite_difference(0),
    "rows are written as Parquet; name the file with .parquet": lambda folder: Store(folder / "a.csv"),
    "no schema of pvid: it begins with 'a'": lambda _: parse_schema("a\nb"),
    "has an array of 0, or more than": lambda _: parse_schema("pvid 1\n1 a b:u8[0]"),
    "only the last field may be open-ended": lambda _: parse_schema("pvid 1\n1 a b:u8[] c:u8"),
    "names a field twice, or more than": lambda _: parse_schema("pvid 1\n1 a b:u8 b:u8"),
    "a schema that describes frame type 1 twice": lambda _: parse_schema("pvid 1\n1 a b:u8\n1 c b:u8"),
    "a frame a with a b of 3 bytes, no multiple of 2": lambda _: parse_schema("pvid 1\n1 a b:u16[]")[1].unpack(b"123"),
    "characters, and 1200 are the most": lambda _: BoardNames.parse(b"x" * 9000),
    "different ones belong": lambda _: BoardNames.parse(b"one\np R ohm"),
    "its tables are nested too deeply": lambda _: toml_document("a = " + "[" * 1990 + "]" * 1990),
    'hold is "line", it must be "zoh" or "sampled"': lambda _: Model("one").input("F", "N", hold="line"),  # type: ignore[arg-type]
    "a and b are new; a term has one new unknown": lambda _: _cart().add("a*x + b"),
    "--own and --shared are of recordings that are identified --together": _own_apart,
    "the largest V of the commissioning is missing: [excitation.V] limit = ": lambda _: _refuse_missing(
        compiled_of("dc_motor"), {}, [compiled_of("dc_motor").signal("V")]
    ),
    "a payload of 5000 bytes, and a frame holds": lambda _: encode_raw(1, 0, 0, bytes(5000)),
    "names no sample and no parameter": lambda _: BoardNames.parse(b"one\nsomething"),
    "/dev/null is a device and no log": lambda _: list(LogReader(Path("/dev/null"))),
    "t is the time: choose another name": lambda _: Model("one").unknown("t", "s", 1),
    "block sums need a decimation above 1": lambda _: WeakDesign(1000.0, 0.1, 12, 6, comb=True),
    "a compensator with 4 nodes has 4 steps on either side or more": lambda _: compensator(2, 1000.0, 1, 2, 10.0, 4),
    "dc_motor has no unknown Q; its unknowns are R,": lambda _: start_of(compiled_of("dc_motor"), {"Q": 1.0}),
    "dc_motor has 7 unknowns, the start has 2 values": lambda _: ready(compiled_of("dc_motor")).parameters.checked(
        np.ones(2)
    ),
    "R must start at a positive number, not -1": lambda _: ready(compiled_of("dc_motor")).parameters.checked(
        np.array([-1.0, *np.ones(6)])
    ),
    "columns t, F and x have 50, 50 and 49 rows": lambda _: recording_of_arrays(
        {"t": np.arange(50.0), "F": np.arange(50.0), "x": np.arange(49.0)}, None, COLUMNS
    ),
    "column 'x' appears 2 times: name it by its position, 3 or 4": _read(f"t,F,x,x\n{ROWS}"),
    "more names than the lines below have cells, 3": _read(f"t,F,x,set,to\n0,1,2,a,5\n{ROWS}", "x=to"),
    "has a header but no data": _read("t,F,x\n"),
    "dates such as 1/2/2024 can be read in two ways": _read(
        "t,F,x\n" + "".join(f"{1 + k // 25}/2/2024 23:{k:02d}:00,{k % 7},{k % 5}\n" for k in range(50))
    ),
    "is not UTF-8 text": _path(b"\xff\xfe\xff"),
    "has no messages": _no_messages,
    "is of another topic than the signals": _other_topic,
    "the other run has a gap": lambda _: between(_rows(3), _rows(2), np.arange(2), 1e-3),
}


def _sizes(**given: Any) -> None:
    none = dict.fromkeys(("update", "data", "budget", "check", "profiled", "core"))
    sizes.command.callback(**{**none, "models": (), "as_json": False, "targets": (), **given})  # type: ignore[misc]


@pytest.mark.parametrize("sentence", CASES)
def test_the_refusal_names_the_cause(sentence: str, tmp_path: Path) -> None:
    with pytest.raises((PvidError, click.BadParameter), match=re.escape(sentence)):
        CASES[sentence](tmp_path)


# ---- all of them

_OWN = re.compile("(Pvid|Model|Column)Error$|error$|refused$|BadParameter$")
_BEHIND = "as far as was tried, another check refuses before"
# By the beginning of a file's path, why its refusals are in no test.
_ELSEWHERE = {
    "base/cluster.py": "a cluster without workers, or whose workers lack pvid",
    "board/": "an emulator, a compiler's listing or a board that fails, and a machine without them",
    "cli/sizes.py": "after minutes in emulators",
    "codegen/build.py": "a file of a build that vanishes",
    "core/headers.py": "a package without its library",
    "codegen/refine.py": _BEHIND,
    "configuration/refine.py": _BEHIND,
    "identification/refinement/inputs.py": _BEHIND,
    "identification/validation.py": _BEHIND,
    "model/": _BEHIND,
    "rig/": _BEHIND,
    "sim/motion.py": _BEHIND,
}


def _text(node: ast.AST | None) -> str:
    """Of a string, with a break for each of its values."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "\0".join(map(_text, node.values))
    return _text(node.left) + _text(node.right) if isinstance(node, ast.BinOp) else "\0"


def _threes(text: str) -> set[tuple[str, ...]]:
    """Three words in a row, without regard to what a value, or a mark of a regular expression, stands between."""
    parts = (re.findall(r"[\w'%-]+", part.lower()) for part in text.replace("\\", "").split("\0"))
    return {tuple(part[k : k + 3]) for part in parts for k in range(len(part) - 2)}


def _refusals() -> Iterator[tuple[str, str]]:
    """File and sentence of each."""
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Raise)
                and isinstance(node.exc, ast.Call)
                and _OWN.search(ast.unparse(node.exc.func))
            ):
                yield str(path.relative_to(SOURCES)), "\0".join(map(_text, node.exc.args))


def test_every_sentence_of_a_refusal_is_in_a_test() -> None:
    """By three words of it, where it has as many; one that is not is tested or deleted, not excused."""
    known: set[tuple[str, ...]] = set()
    for path in TESTS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant | ast.JoinedStr):
                known |= _threes(_text(node))
    found = [(place, text) for place, text in _refusals() if (own := _threes(text)) and not own & known]
    assert [one for one in found if not one[0].startswith(tuple(_ELSEWHERE))] == []
