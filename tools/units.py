"""What tools/analyse.py and tools/loops.py read: the sources of firmware/, with the options of the machines for them.

The core, the link and the applications are read for this machine, for a 32-bit Cortex-M and, where they run there, for
an AVR with its int and size_t of 16 bits; a port for the machine that it is the port of. Applications are compiled for
a rig: headers of tests/analysis replace those that board.stream_image and board.replay_image make.
"""

import argparse
import re
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware"
PORTS = FIRMWARE / "ports"
INCLUDES = [f"-I{FIRMWARE / name}" for name in ("include", "src", "link", "ports", "examples/refine_model")]
RIG = f"-I{ROOT / 'tests' / 'analysis'}"  # of the applications
LANGUAGE = ["-std=c99", "-ffp-contract=off"]

FREESTANDING = ("-ffreestanding", f"-I{PORTS / 'freestanding' / 'include'}")
MACHINES = {  # by family (PVID_BOARD_FAMILY): clang's options
    "host": (),
    "cortex_m": ("--target=thumbv7em-none-eabi", *FREESTANDING),
    "riscv": ("--target=riscv32-none-elf", "-march=rv32imac", *FREESTANDING),
    "avr": ("--target=avr", "-mmcu=atmega2560", "-I/usr/lib/avr/include"),
}


@dataclass(frozen=True)
class Unit:
    """A source as one machine compiles it; `options` are clang's."""

    source: Path
    machine: str
    options: tuple[str, ...]

    @property
    def common(self) -> tuple[str, ...]:
        """The options that are not clang's alone."""
        return tuple(
            option for option in self.options if option not in MACHINES[self.machine] or option in FREESTANDING
        )

    @property
    def name(self) -> str:
        return f"{self.source.relative_to(ROOT)} ({self.machine})"


def _board(name: str) -> tuple[str, str, tuple[str, ...]]:
    """Family, UART and definitions of a board, as ports/boards says."""
    text = (PORTS / "boards" / f"{name}.cmake").read_text(encoding="utf-8")
    said = dict(re.findall(r"^set\(PVID_BOARD_(\w+) (.*)\)$", text, re.MULTILINE))
    definitions = tuple(f"-D{one}" for one in said["DEFINITIONS"].split())
    return said["FAMILY"], said.get("UART", ""), definitions


def _units(machine: str, sources: list[Path], *options: str) -> list[Unit]:
    always = (*LANGUAGE, *MACHINES[machine], *INCLUDES, *options)
    return [Unit(source, machine, always) for source in sources]


def core(machine: str) -> list[Unit]:
    """The core and the link; of an AVR, whose double is a float, the sources are the same."""
    return _units(machine, sorted([*FIRMWARE.glob("src/*/*.c"), *FIRMWARE.glob("link/*.c")]))


def ports() -> list[Unit]:
    """Every port: a board for each UART, and this machine's."""
    found = _units("host", sorted((PORTS / "host").glob("*.c")))
    shared: set[tuple[str, Path]] = set()
    for name in ("mps2-an386", "netduinoplus2", "microbit", "virt-rv32imac", "atmega2560"):
        family, uart, definitions = _board(name)
        sources = [PORTS / "fault.c", *sorted((PORTS / family).glob("*.c"))]
        if uart:
            sources += [PORTS / "start.c", PORTS / "uart" / "uart_port.c", PORTS / "uart" / "receiver.c"]
            sources += [*sorted((PORTS / "freestanding").glob("*.c")), PORTS / "uart" / f"uart_{uart}.c"]
        fresh = [source for source in sources if (family, source) not in shared]
        shared |= {(family, source) for source in fresh}
        found += _units(family, fresh, *definitions)
    return found


def applications(machine: str) -> list[Unit]:
    """`replay` and, but for an AVR, `stream`, of the weak form in every core; of the strong form what differs."""
    found: list[Unit] = []
    board = '-DPVID_BOARD_NAME="board"'
    replay, stream = FIRMWARE / "apps" / "replay", FIRMWARE / "apps" / "stream"
    for number, core_name in enumerate(("f32", "q31")):
        kind = (RIG, board, f"-DSTREAM_CORE={number}", "-DSTREAM_FORM=2")
        found += _units(machine, [replay / "main.c"], *kind)
        if number == 0:
            found += _units(machine, [replay / "report.c"], *kind)
        if machine != "avr":
            found += _units(machine, [stream / f"identifier_weak_{core_name}.c", stream / "main.c"], *kind)
            if number == 0:
                found += _units(machine, [stream / "answers.c", stream / "sensor_recording.c"], *kind)
                strong = (RIG, board, "-DSTREAM_CORE=0", "-DSTREAM_FORM=0")
                found += _units(machine, [stream / "identifier_strong_f32.c"], *strong)
    return found


def everything() -> list[Unit]:
    """Every source for every machine."""
    machines = ("host", "cortex_m", "avr")
    return [unit for machine in machines for unit in core(machine) + applications(machine)] + ports()


# ---- what the tools share on their command lines ----


def take_files(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "files", nargs="*", metavar="FILE", help="from the top of the repository; all, if none is named"
    )


def chosen(units: Iterable[Unit], files: set[str], parser: argparse.ArgumentParser) -> list[Unit]:
    """Those of these files, or all; ends the program where there is no such source."""
    among = [unit for unit in units if not files or str(unit.source.relative_to(ROOT)) in files]
    unknown = files - {str(unit.source.relative_to(ROOT)) for unit in among}
    if unknown:
        parser.error(f"no source of firmware/ is {', '.join(sorted(unknown))}")
    return among


def demand(packages: Mapping[str, str]) -> None:
    """Ends the program where a tool is not there; packages: by the tool's name, Debian's."""
    missing = [package for tool, package in packages.items() if shutil.which(tool) is None]
    if missing:
        raise SystemExit(f"missing: {' '.join(missing)} (Debian's names); ./tools/test installs them")
