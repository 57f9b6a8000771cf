"""The boards of firmware/ports: how an image for each is built and run in its emulator."""

from __future__ import annotations

import re
import select
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock

from pvid.base.errors import PvidError
from pvid.core.host_compiler import compiled_once
from pvid.core.sources import ROOT, build_folder

BUILD = build_folder() / "targets"
SIMAVR_STDIO = BUILD / "simavr_stdio"


@dataclass(frozen=True)
class Board:
    """A board of firmware/ports/boards and the emulator that plays it."""

    name: str
    core: str
    toolchain: str
    emulator: str
    machine: str

    @property
    def compiler(self) -> str:
        """The cross compiler's command."""
        return {"cortex-m": "arm-none-eabi-gcc", "riscv": "riscv64-unknown-elf-gcc", "avr": "avr-gcc"}[self.toolchain]

    @property
    def tool_prefix(self) -> str:
        """What stands before objdump, nm and size."""
        return self.compiler.removesuffix("gcc")

    @property
    def entry(self) -> str:
        """The function that starts on an empty stack."""
        return {"cortex-m": "pvid_reset", "riscv": "pvid_start", "avr": "main"}[self.toolchain]

    def command(self, image: Path) -> list[str]:
        """Runs `image` with the UART on standard input and output; instructions are counted, not timed.

        The exit code is the image's own. For an AVR `simavr_stdio` has to be there: see `prepare_emulator`.
        """
        if self.emulator == "simavr":
            return [str(SIMAVR_STDIO), self.machine, str(image)]
        command = [
            self.emulator,
            "-machine",
            self.machine,
            "-display",
            "none",
            "-monitor",
            "none",
            "-nodefaults",
            "-nic",
            "none",
        ]
        command += ["-serial", "stdio", "-kernel", str(image)]
        if self.toolchain == "riscv":
            return [*command, "-bios", "none", "-icount", "shift=0,sleep=off"]
        return [*command, "-icount", "shift=8,sleep=off", "-semihosting-config", "enable=on,target=native"]

    @property
    def has_fpu(self) -> bool:
        """Whether float32 is computed by the processor itself."""
        return "F" in self.core

    @property
    def sample_bytes(self) -> int:
        """Room for a run in a replay image: half of the code's memory; on an AVR an array has at most 32 kB."""
        if self.toolchain == "avr":
            return 2**15 - 1
        text = (ROOT / "firmware" / "ports" / "boards" / f"{self.name}.cmake").read_text(encoding="utf-8")
        found = re.search(r"\bcode_bytes=(\d+)([KM])\b", text)
        assert found is not None
        return int(found[1]) * {"K": 2**10, "M": 2**20}[found[2]] // 2

    @property
    def missing(self) -> list[str]:
        """Commands that this machine lacks to build for the board and run it."""
        return [tool for tool in (self.compiler, self.emulator) if shutil.which(tool) is None]


def _cortex_m(name: str, core: str) -> Board:
    return Board(name, core, "cortex-m", "qemu-system-arm", name)


BOARDS = {
    board.name: board
    for board in (
        _cortex_m("microbit", "Cortex-M0"),
        _cortex_m("mps2-an385", "Cortex-M3"),
        _cortex_m("mps2-an386", "Cortex-M4F"),
        _cortex_m("netduinoplus2", "Cortex-M4F"),
        _cortex_m("mps2-an500", "Cortex-M7F"),
        _cortex_m("mps2-an505", "Cortex-M33F"),
        _cortex_m("mps3-an547", "Cortex-M55F"),
        Board("virt-rv32imac", "RV32IMAC", "riscv", "qemu-system-riscv32", "virt"),
        Board("virt-rv32imafc", "RV32IMAFC", "riscv", "qemu-system-riscv32", "virt"),
        Board("atmega2560", "ATmega2560", "avr", "simavr", "atmega2560"),
        Board("atmega328p", "ATmega328P", "avr", "simavr", "atmega328p"),
    )
}


def board(name: str) -> Board:
    """The board of that name. Raises PvidError when there is none."""
    if name not in BOARDS:
        raise PvidError(f"there is no board {name}; there are {', '.join(BOARDS)}")
    return BOARDS[name]


def build(target: Board, tree: Path, options: Mapping[str, str], source: Path = ROOT / "firmware") -> Path:
    """Builds firmware/ for a board into `tree` with these CMake variables; returns `tree`.

    Raises PvidError when the compiler is missing or something does not build.

    Parameters
    ----------
    source : another CMake project, which contains it
    """
    if shutil.which(target.compiler) is None:
        raise PvidError(f"{target.compiler} is not installed: it comes with ./tools/test")
    configure = ["cmake", "-S", str(source), "-B", str(tree), "-G", "Ninja"]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'firmware' / 'cmake' / target.toolchain}.cmake"]
    configure += [f"-DPVID_BOARD={target.name}", "-DPVID_DEVELOPER=ON"]
    configure += ["-DCMAKE_C_FLAGS_RELWITHDEBINFO=-O2 -g1 -DNDEBUG"]  # costs by file need the places of functions alone
    configure += [f"-D{name}={value}" for name, value in options.items()]
    configure += ["-DCMAKE_C_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    environment = compiled_once()
    with one_at_a_time(tree):
        for command in (configure, ["cmake", "--build", str(tree)]):
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
            if done.returncode != 0:
                lines = (done.stdout + done.stderr).strip().splitlines()
                full = [re.search(r"region `(\w+)' overflowed by (\d+) bytes", line) for line in lines]
                if any(full):
                    said = ", ".join(sorted({f"{one[1]} lacks {one[2]} bytes" for one in full if one}))
                    raise PvidError(f"{target.name}: the image does not fit: {said}")
                if any(re.search(r"section `\.\w+' is not within region `data'", line) for line in lines):
                    raise PvidError(f"{target.name}: the image does not fit: its variables exceed the RAM")
                if any("error: size of array" in line and "is too large" in line for line in lines):
                    raise PvidError(f"{target.name}: the image does not fit: an array is too large for its compiler")
                errors = [line for line in lines if re.search(r"\berror:|undefined|overflowed|CMake Error", line)]
                raise PvidError(f"{target.name}: the build failed: {' '.join((errors or lines or ['no output'])[:2])}")
    return tree


def one_at_a_time(made: Path) -> FileLock:
    """A lock for making `made`, a file or a tree: tests run in several processes, and users in several terminals."""
    made.parent.mkdir(parents=True, exist_ok=True)
    return FileLock(made.with_name(f".{made.name}.lock"))


def keep_header(folder: Path, name: str, text: str) -> None:
    """Writes a generated header where it is not there yet, whole or not at all: else the build has nothing to do."""
    place = folder / name
    with one_at_a_time(folder):
        if place.exists() and place.read_text(encoding="utf-8") == text:
            return
        folder.mkdir(parents=True, exist_ok=True)
        fresh = place.with_suffix(".new")
        fresh.write_text(text, encoding="utf-8")
        fresh.replace(place)


def prepare_emulator(target: Board) -> None:
    """Makes sure that `target.command` can be run. Raises PvidError when the emulator is not installed."""
    if shutil.which(target.emulator) is None:
        raise PvidError(f"{target.emulator} is not installed: it comes with ./tools/test")
    if target.emulator == "simavr":
        with one_at_a_time(SIMAVR_STDIO):
            _build_simavr_stdio()


def _build_simavr_stdio() -> None:
    source = ROOT / "host" / "native" / "simavr_stdio.c"
    if SIMAVR_STDIO.exists() and SIMAVR_STDIO.stat().st_mtime >= source.stat().st_mtime:
        return
    fresh = SIMAVR_STDIO.with_suffix(".new")
    command = ["gcc", "-std=gnu99", "-O2", "-I/usr/include/simavr", str(source), "-lsimavr", "-lelf", "-o", str(fresh)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise PvidError(f"simavr_stdio did not build (libsimavr-dev, libelf-dev): {done.stderr.strip()[:200]}")
    fresh.replace(SIMAVR_STDIO)


@dataclass(frozen=True)
class Outcome:
    """What a run in an emulator left."""

    sent: bytes  # over the UART
    exit_code: int
    complaints: str  # the emulator's own

    @property
    def text(self) -> str:
        """What was sent, as lines."""
        return self.sent.decode("ascii", "replace").replace("\r", "")


def run(target: Board, image: Path, timeout: float, machine: str | None = None, input_bytes: bytes = b"") -> Outcome:
    """Runs an image in its board's emulator until it exits, `timeout` seconds at most.

    Raises PvidError when the emulator is missing or the image does not exit in time.

    Parameters
    ----------
    input_bytes : what the image receives over its UART, from when it has sent something
    machine : another machine of the same emulator
    """
    prepare_emulator(target)
    command = [machine if machine and part == target.machine else part for part in target.command(image)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        if input_bytes and process.stdout is not None:  # a UART that is not yet switched on drops what comes
            select.select([process.stdout], [], [], timeout)
        sent, complaints = process.communicate(input_bytes, timeout=timeout)
    except subprocess.TimeoutExpired as error:
        process.kill()
        sent, _ = process.communicate()
        said = sent.decode("ascii", "replace").strip().splitlines()
        raise PvidError(
            f"{target.name}: no end after {timeout:g} s; its last words: {said[-1] if said else 'nothing'}"
        ) from error
    except BaseException:
        process.kill()
        raise
    return Outcome(sent, process.returncode, complaints.decode("utf-8", "replace"))
