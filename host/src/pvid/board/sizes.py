"""What the core costs on every board: flash, RAM, stack and instructions a tick, measured on the replay image."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS, Board
from pvid.board.refined_image import RefinedRun, build_refined_image, published_run
from pvid.board.replay_image import ReplayReport, play
from pvid.board.stack_bound import stack_bound
from pvid.board.strong_image import build_image, standard_run
from pvid.board.weak_image import weak_image
from pvid.settings.cores import CORES
from pvid.settings.forms import FORMS

STANDARD = "kapitza"  # whose figures stand in the budget and on the page without the name of a mechanism
REFINED_TICKS = 21_000  # the refinement finds its track in the first 6 600; the last 16 half windows count
TIMEOUT_S = 300.0
ALLOWANCE = 1.02

HEADER = (
    "target",
    "form",
    "text",
    "arithmetic",
    "tables",
    "data",
    "bss",
    "stack bound",
    "stack seen",
    "mean",
    "longest",
)


@dataclass(frozen=True)
class Configuration:
    """A board, the arithmetic and the form of the identifier, of the shipped rig of `model`.
    "refined" is the weak form with the refinement behind it, "block" the weak form with its samples in blocks."""

    board: Board
    form: str
    core: str = "f32"
    model: str = STANDARD

    @property
    def name(self) -> str:
        """Key of the budget."""
        model = "" if self.model == STANDARD else f" {self.model}"
        return f"{self.board.name} {self.form} {self.core}{model}"


WEAK, REFINED, IN_BLOCKS = "weak", "refined", "block"
ALL = (("weak", "f32"), ("weak", "q31"), ("strong", "f32"))

# An AVR: what its memory holds, in fixed point alone, since its float32 division differs at the extremes.
ON_AVR = {"atmega2560": (("weak", "q31"),), "atmega328p": ()}

# The refinement is in float32: a processor with an FPU, and two without.
WITH_REFINEMENT = ("microbit", "mps2-an385", "mps2-an386")

# Boards whose samples are given in blocks as well: a DMA fills them.
WITH_DMA = ("mps2-an386",)

CONFIGURATIONS = tuple(
    Configuration(board, form, core)
    for board in BOARDS.values()
    for form, core in (
        *ON_AVR.get(board.name, ALL),
        *([(REFINED, "f32")] if board.name in WITH_REFINEMENT else []),
        *([(IN_BLOCKS, "f32"), (IN_BLOCKS, "q31")] if board.name in WITH_DMA else []),
    )
)


@dataclass(frozen=True)
class Footprint:
    """Bytes, and instructions a tick (an AVR: clock cycles); in blocks `longest` is that of a block.

    text: the core's code and constants; arithmetic: what the compiler adds for it (soft float, division, memcpy);
    tables: the design's; data, bss: the core's variables, of which bss is the identifier's state; stack_bound and
    stack_seen: proven from the code and found by painting, for the whole image.
    """

    text: int
    arithmetic: int
    tables: int
    data: int
    bss: int
    stack_bound: int
    stack_seen: int
    mean: int
    longest: int


def sections(map_text: str) -> Iterator[tuple[str, int, str]]:
    """(input section, bytes, object it comes from) of everything that the linker kept, from its map."""
    kept = map_text.partition("Linker script and memory map")[2]
    entry = re.compile(r"^ (\.[^\s*]+|COMMON)\s+0x[0-9a-f]+\s+0x([0-9a-f]+)\s+(\S.*)$", re.MULTILINE)
    for name, size, source in entry.findall(kept):
        if int(size, 16):
            yield name, int(size, 16), source


def _bytes_of(map_text: str, name: str, source: str) -> int:
    wanted, origin = re.compile(name), re.compile(source)
    return sum(size for section, size, file in sections(map_text) if wanted.match(section) and origin.search(file))


CORE = r"libpvid\.a\("  # in the linker's map: objects of the core
_MODEL = r"_weak_(f32|q31)\.c"  # what is generated of a mechanism
ARITHMETIC = r"libgcc\.a\(|libm\.a\(|libc\.a\(|freestanding/"
CODE = r"\.text|\.s?rodata"  # sections


def measure(configuration: Configuration) -> tuple[Footprint, ReplayReport]:
    """Builds and runs the replay image of a configuration.

    Raises PvidError when a compiler or emulator is missing, or the image fails.
    """
    return measured(configuration.board, _BUILT[configuration.form](configuration))


@dataclass(frozen=True)
class BuiltImage:
    """An image with what is counted in it.

    image, tree: the file, and where it was built; code, tables, state: (section, origin) of the core's code and
    constants, of the design's tables, and of variables of the application beside the identifier, as patterns.
    """

    image: Path
    tree: Path
    code: tuple[tuple[str, str], ...]
    tables: tuple[tuple[str, str], ...]
    state: tuple[tuple[str, str], ...] = ()


def _strong(configuration: Configuration) -> BuiltImage:
    design = standard_run(configuration.model)
    name = design.strong.functions.name
    tables = ((rf"\.s?rodata\.{name}_(weights|config)", "replay"),)
    own = rf"{name}_f32\.c"
    return BuiltImage(*build_image(configuration.board, design), ((CODE, CORE), (CODE, own)), tables)


def _weak(configuration: Configuration) -> BuiltImage:
    """Of a mechanism on its shipped rig; the model's own code and tables count as text and tables."""
    blocks = configuration.form == IN_BLOCKS
    made = weak_image(configuration.board, configuration.model, CORES[configuration.core].name, blocks=blocks)
    return built_weak(made.image, made.tree, made.name)


def built_weak(image: Path, tree: Path, name: str) -> BuiltImage:
    """An image of the weak identifier with the mechanism called `name` in C."""
    tables = rf"\.(s?rodata|progmem\.data|progmem\d?\.data)\.({name}_|replay_refine_config)"
    return BuiltImage(
        image,
        tree,
        ((CODE, CORE), (r"\.text", _MODEL)),
        ((r"\.s?rodata", _MODEL), (tables, "replay")),
        ((r"\.s?bss\.replay_refinement$", "replay"),),
    )


@cache
def refined_replay(board: Board) -> RefinedRun:
    """What the image of the refinement plays on a board."""
    return published_run(STANDARD, REFINED_TICKS, board)


def _refined(configuration: Configuration) -> BuiltImage:
    run = refined_replay(configuration.board)
    return built_weak(*build_refined_image(configuration.board, run), run.weak.name)


_BUILT: dict[str, Callable[[Configuration], BuiltImage]] = {
    **dict(zip(FORMS, (_weak, _strong), strict=True)),
    REFINED: _refined,
    IN_BLOCKS: _weak,
}


def measured(board: Board, built: BuiltImage) -> tuple[Footprint, ReplayReport]:
    """Runs an image and counts what is in it. Raises PvidError when the emulator is missing, or the image fails."""
    map_text = built.image.with_suffix(".map").read_text(encoding="utf-8")
    report = play(board, built.image, TIMEOUT_S)
    footprint = Footprint(
        text=sum(_bytes_of(map_text, *one) for one in built.code),
        arithmetic=_bytes_of(map_text, CODE, ARITHMETIC),
        tables=sum(_bytes_of(map_text, *one) for one in built.tables),
        data=_bytes_of(map_text, r"\.s?data", CORE),
        bss=_bytes_of(map_text, r"\.s?bss|COMMON", CORE)
        + sum(_bytes_of(map_text, *one) for one in built.state)
        + report.state_bytes,
        stack_bound=stack_bound(board.tool_prefix, built.image, built.tree, board.entry),
        stack_seen=report.stack_used,
        mean=round(report.instructions_mean),
        longest=round(report.instructions_longest),
    )
    return footprint, report


def configurations_on(boards: Sequence[Board], models: Sequence[str], core: str = "f32") -> list[Configuration]:
    """All forms and cores on some boards; with models the weak form of each of them in one arithmetic instead."""
    if models:
        return [Configuration(board, WEAK, core, model) for board in boards for model in models]
    return [one for one in CONFIGURATIONS if one.board in boards]


def as_json(footprints: Mapping[Configuration, Footprint]) -> list[dict[str, object]]:
    """The list of `sizes --json`."""
    return [
        {"target": one.board.name, "model": one.model, "form": one.form, "core": one.core, **figures_of(found)}
        for one, found in footprints.items()
    ]


def figures_of(found: Footprint) -> dict[str, int]:
    """In an object of `sizes --json`."""
    return {
        "text": found.text + found.arithmetic,
        "tables": found.tables,
        "data": found.data,
        "state": found.bss,
        "stack_bound": found.stack_bound,
        "mean": found.mean,
        "longest": found.longest,
    }


def table_rows(footprints: dict[Configuration, Footprint]) -> list[tuple[str, ...]]:
    """Cells of the table `sizes`, as in HEADER."""
    return [
        (
            f"{configuration.board.core} ({configuration.board.name})",
            _form_of(configuration),
            *(str(getattr(footprint, name)) for name in Footprint.__dataclass_fields__),
        )
        for configuration, footprint in footprints.items()
    ]


def _form_of(configuration: Configuration) -> str:
    """In the table."""
    model = "" if configuration.model == STANDARD else f"{configuration.model}, "
    return f"{model}{configuration.form}, {configuration.core}"


# ---- a summary: a table whose rows begin with form and board, then figures, then what is measured otherwise

SUMMARY = "costs"  # its marker


def _begin(configuration: Configuration) -> str:
    """Of a row of the summary."""
    return f"| {_form_of(configuration)} | {configuration.board.core} ({configuration.board.name}) |"


def named_in(summary: str) -> list[Configuration]:
    """What the rows of a summary name."""
    return [one for one in CONFIGURATIONS if _begin(one) in summary]


def with_costs(summary: str, footprints: Mapping[Configuration, Footprint]) -> str:
    """The summary with these figures: instructions, RAM and stack, code and tables."""
    lines = summary.splitlines()
    for configuration, found in footprints.items():
        begin = _begin(configuration)
        figures = f"{found.mean} / {found.longest} | {found.bss} + {found.stack_bound} | {found.text} + {found.tables}"
        for at, line in enumerate(lines):
            if line.startswith(begin):
                rest = line.removeprefix(begin).split("|", 3)[3]
                lines[at] = f"{begin} {figures} |{rest}"
    return "\n".join(lines)


# ---- the budget

OPENING, CLOSING = "# <sizes>", "# </sizes>"


def budget_text(footprints: dict[Configuration, Footprint]) -> str:
    """The budget's lines: one table a configuration."""
    lines = []
    for configuration, footprint in footprints.items():
        figures = ", ".join(f"{name} = {getattr(footprint, name)}" for name in Footprint.__dataclass_fields__)
        lines.append(f'"{configuration.name}" = {{ {figures} }}')
    return "\n".join(["[targets]", *lines])


def write_budget(path: Path, footprints: dict[Configuration, Footprint]) -> None:
    """Replaces the budget between its marks in `path`. Raises PvidError when the file has no place for it."""
    old = path.read_text(encoding="utf-8")
    if OPENING not in old or CLOSING not in old:
        raise PvidError(f"{path} does not contain the marker lines of the budget, {OPENING} and {CLOSING}")
    head, rest = old.split(OPENING, 1)
    write_whole(path, f"{head}{OPENING}\n{budget_text(footprints)}\n{CLOSING}{rest.split(CLOSING, 1)[1]}", freely=True)


def _targets_in(path: Path) -> dict[str, dict[str, int]]:
    """The figures in a budget, by the name of the configuration."""
    targets: dict[str, dict[str, int]] = tomllib.loads(path.read_text(encoding="utf-8")).get("targets", {})
    return targets


def budgeted(path: Path) -> dict[Configuration, Footprint]:
    """The figures in a budget."""
    targets = _targets_in(path)
    return {one: Footprint(**targets[one.name]) for one in CONFIGURATIONS if one.name in targets}


def over_budget(path: Path, footprints: dict[Configuration, Footprint]) -> list[str]:
    """A sentence for every figure that exceeds its budget in `path` by more than 2 %, or has none."""
    allowed = _targets_in(path)
    found = []
    for configuration, footprint in footprints.items():
        limits = allowed.get(configuration.name, {})
        for name in Footprint.__dataclass_fields__:
            figure, limit = getattr(footprint, name), limits.get(name)
            if limit is None:
                found.append(f"{configuration.name}: {name} has no budget")
            elif figure > ALLOWANCE * limit:
                found.append(f"{configuration.name}: {name} is {figure}, its budget {limit}")
    return found
