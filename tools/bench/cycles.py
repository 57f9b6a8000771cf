"""Clock cycles of a tick on a real core: CV32E40P, translated from its RTL by verilator, with ideal memory.

The replay images of firmware/apps run on it as they do on a board; what they report is compared with the core on this
machine first, hash by hash.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from bench.case import DIFFERS, Advance, Report
from pvid.base.errors import PvidError
from pvid.board import mechanism_image, mechanism_image_q31, replay_image
from pvid.board.boards import Board, one_at_a_time
from pvid.core.sources import build_folder

PACKAGE = "pythondata_cpu_cv32e40p"
CLOCKS_MHZ = (16, 48, 100)
RATE_HZ = 1000
HEADER = (
    "identifier",
    "FPU",
    "ticks",
    "mean",
    "longest",
    *(f"% of {clock} MHz" for clock in CLOCKS_MHZ),
    "bits",
)
_OWN = Path(__file__).parent / "cv32e40p"
_TOP = "cv32e40p_top"
_TIMEOUT_S = 1800.0

Hashes = npt.NDArray[np.uint32]
Run = TypeVar("Run")


@dataclass(frozen=True)
class Hardware:
    """A configuration of the core.

    Attributes
    ----------
    board : of firmware/ports/boards
    parameters : of the module at the top
    """

    title: str
    board: Board
    parameters: tuple[tuple[str, int], ...]


def _with_fpu(latency: int) -> Hardware:
    lanes = (("FPU", 1), ("FPU_ADDMUL_LAT", latency), ("FPU_OTHERS_LAT", latency))
    return Hardware(f"latency {latency}", Board("cv32e40p-fpu", "CV32E40P", "riscv", _TOP, ""), lanes)


WITHOUT = Hardware("none", Board("cv32e40p", "CV32E40P", "riscv", _TOP, ""), (("FPU", 0),))
FPUS = (_with_fpu(0), _with_fpu(2))


@dataclass(frozen=True)
class Case:
    """A replay image: `build` makes it for a board, `hashes` are those of the core on this machine after every tick."""

    title: str
    build: Callable[[Board], tuple[Path, Path]]
    hashes: Callable[[], Hashes]


def _case(
    title: str, run: Run, build: Callable[[Board, Run], tuple[Path, Path]], hashes: Callable[[Run], Hashes]
) -> Case:
    return Case(title, lambda board: build(board, run), lambda: hashes(run))


def _weak_f32(model: str) -> Case:
    run = mechanism_image.mechanism_run(model)
    return _case(f"weak, f32, {model}", run, mechanism_image.build_mechanism_image, mechanism_image.native_hashes)


def _weak_q31(model: str) -> Case:
    run = mechanism_image_q31.fixed_run(model)
    return _case(f"weak, q31, {model}", run, mechanism_image_q31.build_fixed_image, mechanism_image_q31.native_hashes)


# What is made of each row of the table, and the cores that play it.
_ROWS: tuple[tuple[Callable[[], Case], tuple[Hardware, ...]], ...] = (
    (lambda: _weak_f32("kapitza"), FPUS),
    (lambda: _weak_f32("dc_motor"), FPUS),
    (lambda: _weak_q31("kapitza"), (WITHOUT,)),
)


def cycle_rows(processes: int, progress: Callable[[], object] = lambda: None) -> Iterator[tuple[str, ...]]:
    """The table of the page, as in HEADER.

    Raises
    ------
    PvidError
        When verilator, a compiler or the package of the core's RTL is missing, or an image fails.
    """
    simulators = {core.title: simulator(core) for core in (*FPUS, WITHOUT)}
    played = []
    with ThreadPoolExecutor(processes) as pool:
        for make, cores in _ROWS:
            case = make()
            hashes = case.hashes()
            for core in cores:
                image = case.build(core.board)[0]
                played.append((case, core, hashes, pool.submit(play, simulators[core.title], image)))
        for case, core, hashes, future in played:
            report = future.result()
            yield row_of(case.title, core.title, report, same_bits(report, hashes))
            progress()


def report(processes: int, advance: Advance) -> Report:
    """See bench.case."""
    return Report([("cycles", HEADER, cycle_rows(processes, advance))])


def row_of(title: str, fpu: str, report: replay_image.ReplayReport, equal: bool) -> tuple[str, ...]:
    """Cells of a run; its instructions are clock cycles."""
    mean, longest = round(report.instructions_mean), round(report.instructions_longest)
    shares = (f"{share(mean, clock):.2f}" for clock in CLOCKS_MHZ)
    return (title, fpu, str(report.ticks), str(mean), str(longest), *shares, "equal" if equal else DIFFERS)


def share(cycles: int, clock_mhz: int) -> float:
    """Of a core's time at RATE_HZ [%]."""
    return 100.0 * cycles * RATE_HZ / (clock_mhz * 1e6)


def same_bits(report: replay_image.ReplayReport, hashes: Hashes) -> bool:
    """Whether every running hash that the image reported is that of the core on this machine."""
    return len(hashes) == report.ticks and report.differs_at(hashes) is None


def play(machine: Path, image: Path) -> replay_image.ReplayReport:
    """Runs an image on the simulated core and reads its report.

    Raises
    ------
    PvidError
        When it stops, or does not end.
    """
    binary = image.with_suffix(".bin")
    copied = ["riscv64-unknown-elf-objcopy", "-O", "binary", str(image), str(binary)]
    subprocess.run(copied, check=True, capture_output=True)
    try:
        done = subprocess.run([str(machine), str(binary)], capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise PvidError(f"{image.name} did not end on the simulated core within {_TIMEOUT_S:g} s") from error
    report = replay_image.parse_report(done.stdout.decode("ascii", "replace"))
    if done.returncode != 0:
        raise PvidError(f"{image.name} ended with exit code {done.returncode} on the simulated core")
    return report


# ---- the simulator


def simulator(core: Hardware) -> Path:
    """The core as a program, built once for these sources, this version of the RTL and of verilator.

    Raises
    ------
    PvidError
        When something that it needs is missing, or it does not build.
    """
    missing = [tool for tool in ("verilator", "g++", "make") if shutil.which(tool) is None]
    package = find_spec(PACKAGE)
    if missing or package is None or package.origin is None:
        names = [*missing, *([] if package else [PACKAGE])]
        raise PvidError(f"{' and '.join(names)} not installed: ./tools/pvid bench cycles installs what it needs")
    command = ["verilator", "--cc", "--exe", "--build", "-O3", "--x-assign", "fast", "--x-initial", "fast"]
    # Of the RTL's own style; blocking and other assignments of one variable are of different bits of it.
    command += ["-Wno-fatal", "-Wno-lint", "-Wno-style", "-Wno-BLKANDNBLK", "-CFLAGS", "-O2", "--top-module", _TOP]
    command += [f"-G{name}={value}" for name, value in core.parameters]
    command += rtl(Path(package.origin).parent / "system_verilog" / "rtl")
    own = sorted(_OWN.glob("*.*"))
    version = subprocess.run(["verilator", "--version"], capture_output=True, check=True).stdout
    made_from = "\n".join(command).encode() + version + b"".join(path.read_bytes() for path in own)
    folder = build_folder() / "cv32e40p" / f"{core.title.replace(' ', '-')}-{zlib.crc32(made_from):08x}"
    with one_at_a_time(folder):
        if not (folder / "built").exists():
            folder.mkdir(parents=True, exist_ok=True)
            whole = [*command, *map(str, own), "--Mdir", str(folder)]
            done = subprocess.run(whole, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                errors = re.findall(r"^.*(?:%Error|error:).*$", done.stdout + done.stderr, re.MULTILINE)
                raise PvidError(f"the simulated core did not build: {' '.join(errors[:2])[:300]}")
            (folder / "built").touch()
    return folder / f"V{_TOP}"


def rtl(folder: Path) -> list[str]:
    """Arguments of verilator: the sources that the core lists, without its models of cells (clock_gate.sv is ours)."""
    text = (folder.parent / "cv32e40p_fpu_manifest.flist").read_text(encoding="utf-8")
    lines = [line.strip().replace("${DESIGN_RTL_DIR}", str(folder)) for line in text.splitlines()]
    return [line for line in lines if line.startswith(("+incdir+", "/")) and not re.search(r"^//|/bhv/.*\.sv$", line)]
