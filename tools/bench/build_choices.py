"""What the choices of a build of the weak form give: bytes and instructions on the pendulum's shipped rig."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from bench.case import Advance, Report
from pvid.board import mechanism_image, mechanism_image_q31
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import build_with, mechanism_run
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.board.refined_image import build_refined_image
from pvid.board.sizes import Footprint, built_weak, measured, refined_replay
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.settings.enums import Core

HEADER = ("choice", "text", "state", "mean", "longest")


@dataclass(frozen=True)
class Choice:
    """A build: its sizes beside those that `pvid model build` prints, and variables of CMake."""

    title: str
    core: Core = "f32"
    refined: bool = False
    sizes: Mapping[str, int] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def board(self) -> str:
        """On which it is measured."""
        return "mps2-an386" if self.core == "f32" else "microbit"


_PARTS = {f"PVID_{one}": 1 for one in ("REFINEMENT", "DEAD_ZONE", "FEEDBACK", "SHARED")}
_USUAL = {"CMAKE_BUILD_TYPE": "RelWithDebInfo", "PVID_COLD_OPTIONS": ""}
_COLD = {"PVID_COLD_OPTIONS": "-Os"}
_SMALL = {"CMAKE_BUILD_TYPE": "MinSizeRel"}
CHOICES = (
    Choice(
        "float32, Cortex-M4F, nothing chosen but the loops",
        sizes=_PARTS | {"PVID_CHECK_TABLES": 1, "PVID_MAX_WINDOWS": 1},
    ),
    Choice(
        "the window's sums in the place of the older half's: `PVID_MAX_WINDOWS=0`",
        sizes=_PARTS | {"PVID_CHECK_TABLES": 1},
    ),
    Choice("and no check of the printed tables: `PVID_CHECK_TABLES=0`", sizes=_PARTS),
    Choice("and no second stage, no dead zone, no law with g < 1, no shared errors: what `pvid model build` prints"),
    Choice("and `-DPVID_COLD_OPTIONS=-Os`", options=_COLD),
    Choice("or all of it with `-Os` (`MinSizeRel`)", options=_SMALL),
    Choice("both stages, as printed", refined=True),
    Choice("and `-DPVID_COLD_OPTIONS=-Os`", refined=True, options=_COLD),
    Choice("or all of it with `-Os`", refined=True, options=_SMALL),
    Choice("fixed point, Cortex-M0, as printed", "q31"),
    Choice("and `-DPVID_COLD_OPTIONS=-Os`", "q31", options=_COLD),
    Choice("or all of it with `-Os`", "q31", options=_SMALL),
)


def footprint_of(choice: Choice, place: int) -> Footprint:
    """Builds and plays it."""
    board = BOARDS[choice.board]
    choices = _USUAL | dict(choice.options)
    if choice.refined:
        both = refined_replay(board)
        image, tree = build_refined_image(board, both, f"choice-{place}", choices)
        return measured(board, built_weak(image, tree, both.weak.name))[0]
    if choice.core == "f32":
        run = mechanism_run("kapitza", long=True)
        name, files, fitted = run.name, mechanism_image.files_of(run), fitted_sizes(run.config)
    else:
        fixed = fixed_run("kapitza", long=True)
        name, files, fitted = fixed.name, mechanism_image_q31.files_of(fixed), fixed.sizes
    sizes = fitted | dict(choice.sizes)
    image, tree = build_with(board, f"choice-{place}", files, sizes, choice.core, choices=choices)
    return measured(board, built_weak(image, tree, name))[0]


def report(advance: Advance) -> Report:
    """See bench.case."""

    def rows() -> Iterator[tuple[str, ...]]:
        for place, choice in enumerate(CHOICES):
            found = footprint_of(choice, place)
            yield choice.title, *map(str, (found.text, found.bss, found.mean, found.longest))
            advance()

    return Report([("build-choices", HEADER, rows())])
