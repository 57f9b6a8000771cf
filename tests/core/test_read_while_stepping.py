"""An estimate that is read while others step is whole: threads under ThreadSanitizer, interrupts in emulators."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest
from conftest import ROOT
from processes import PATIENCE_S

from pvid.board.boards import BOARDS, BUILD, build, run
from pvid.core.sources import INCLUDES, core_sources, left_out, source

PROGRAM = ROOT / "tests" / "threads" / "read_while_stepping.c"
ROOMS = ("number", "solve", "judge", "weak")


def play_threads(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    sources = [path for path in core_sources("*_f32.c") if path.parent.name in ROOMS]
    command = ["clang", "-std=c99", "-O1", "-g", "-fsanitize=thread", *options, *INCLUDES, str(PROGRAM)]
    command += [
        str(source("publication.c")),
        str(source("standing.c")),
        str(source("kinds.c")),
        str(source("fnv.c")),
        *map(str, sources),
        "-lm",
        "-lpthread",
        "-o",
        str(folder / "read"),
    ]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return subprocess.run([str(folder / "read")], capture_output=True, text=True, check=False, timeout=PATIENCE_S)


def test_threads_read_whole_estimates_without_a_data_race(tmp_path: Path) -> None:
    done = play_threads(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stderr
    words = re.search(r"puts (\d+) reads (\d+) torn 0 backwards 0 missed", done.stdout)
    weak = re.search(r"published (\d+) reads (\d+) torn 0", done.stdout)
    assert words is not None and weak is not None
    assert int(words[2]) > 1000 and int(weak[1]) > 50 and int(weak[2]) > 1000


def test_a_plain_copy_is_a_data_race(tmp_path: Path) -> None:
    """What the test above can see."""
    done = play_threads(tmp_path, "-DPLAIN_COPY")
    assert done.returncode != 0
    assert "WARNING: ThreadSanitizer: data race" in done.stderr


@cache
def counted(name: str) -> dict[str, int]:
    """What the image of tests/ports counted on a board."""
    board = BOARDS[name]
    tree = BUILD / f"{name}-reads"
    options = {"PORT_CHECK_TABLES": "", "PORT_CHECK_READS": "ON", "PVID_LEAVE_OUT": left_out("weak", "f32")}
    build(board, tree, options, source=ROOT / "tests" / "ports")
    outcome = run(board, tree / "read_check.elf", PATIENCE_S)
    assert outcome.exit_code == 0, outcome.text
    return {key: int(value) for key, value in re.findall(r"^(\w+) (\d+)$", outcome.text, re.MULTILINE)}


# one core with atomic accesses, one with volatile ones
interrupted = pytest.mark.parametrize("name", ["mps2-an386", "microbit"])


@interrupted
def test_an_interrupt_reads_whole_estimates_wherever_it_stops_a_publication(name: str) -> None:
    found = counted(name)
    assert found["interrupt_reads"] > 1000 and found["interrupt_odd"] > 100  # in the middle of a put
    assert found["interrupt_torn"] == found["interrupt_missed"] == 0
    assert found["interrupt_plain_torn"] > 0  # what a plain copy makes of the same


@interrupted
def test_the_main_loop_reads_whole_estimates_while_an_interrupt_publishes(name: str) -> None:
    found = counted(name)
    assert found["loop_reads"] > 1000 and found["loop_again"] > 100  # read again
    assert found["loop_torn"] == 0
    assert found["loop_plain_torn"] > 0
