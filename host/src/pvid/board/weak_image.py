"""The replay image of the weak form with a shipped mechanism, in either arithmetic, on a run long enough to count."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pvid.board.boards import Board
from pvid.board.mechanism_image import build_mechanism_image, mechanism_run
from pvid.board.mechanism_image_q31 import build_fixed_image, fixed_run
from pvid.settings.cores import CORES
from pvid.settings.enums import Core


@dataclass(frozen=True)
class WeakImage:
    """An image that is built.

    Attributes
    ----------
    image, tree : the file, and where it was built
    name : of the mechanism, in C
    measure_from : first tick that counts in the mean cost of a tick
    """

    image: Path
    tree: Path
    name: str
    measure_from: int


def weak_image(board: Board, model: str, core: Core, *, blocks: bool = False) -> WeakImage:
    """Builds it for a board; blocks: of samples. PvidError where there is no such mechanism, or it does not build."""
    return _IMAGES[core](board, model, blocks)


def _in_float(board: Board, model: str, blocks: bool) -> WeakImage:
    run = mechanism_run(model, long=True)
    return WeakImage(*build_mechanism_image(board, run, blocks=blocks), run.name, run.measure_from)


def _in_fixed_point(board: Board, model: str, blocks: bool) -> WeakImage:
    run = fixed_run(model, long=board.toolchain != "avr")  # which has no larger arrays than 32 kB
    return WeakImage(*build_fixed_image(board, run, blocks=blocks), run.name, run.measure_from)


_IMAGES = dict(zip(CORES, (_in_float, _in_fixed_point), strict=True))
