"""The weak form of every shipped mechanism on every emulated board, in both cores: its bits, and the cost of a tick."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS, Board
from pvid.board.mechanism_image import build_mechanism_image, mechanism_run
from pvid.board.mechanism_image import twin_hashes as float_hashes
from pvid.board.mechanism_image_q31 import build_fixed_image, fixed_run
from pvid.board.mechanism_image_q31 import twin_hashes as fixed_hashes
from pvid.board.replay_image import ReplayReport, play
from pvid.models import mechanisms
from pvid.settings.enums import Core

HEADER = ("board", "core", *mechanisms.names(), "bits")
CORES: tuple[Core, ...] = ("f32", "q31")
ROWS = tuple((board, core) for board in BOARDS.values() for core in CORES)
TIMEOUT_S = 600.0


def differs(report: ReplayReport, expected: npt.NDArray[np.uint32]) -> bool:
    """Whether a hash of the board is not that of the twin at the same tick, or the run ended early."""
    return report.ticks != len(expected) or report.differs_at(expected) is not None


def played(board: Board, name: str, core: Core) -> tuple[ReplayReport, npt.NDArray[np.uint32]]:
    """A mechanism's shipped rig on a board, and the hashes of the twin.

    Raises
    ------
    PvidError
        Where it does not fit.
    """
    if core == "f32":
        run = mechanism_run(name)
        return play(board, build_mechanism_image(board, run)[0], TIMEOUT_S), float_hashes(run)
    fixed = fixed_run(name)
    return play(board, build_fixed_image(board, fixed)[0], TIMEOUT_S), fixed_hashes(fixed)


def row_of(board: Board, core: Core, names: tuple[str, ...] = tuple(mechanisms.names())) -> tuple[str, ...]:
    """Mean instructions of a tick (an AVR: clock cycles) of each mechanism, and whether all bits are the twin's."""
    cells, equal = [], "-"
    for name in names:
        try:
            report, expected = played(board, name, core)
        except PvidError as error:
            cells.append("no room" if "fit" in str(error) else "no float32")
            continue
        cells.append(f"{report.instructions_mean:.0f}")
        equal = "DIFFERENT" if differs(report, expected) or equal == "DIFFERENT" else "equal"
    return f"{board.core} ({board.name})", core, *cells, equal


def rows_of(progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """All rows."""
    for done, (board, core) in enumerate(ROWS):
        progress(done)
        yield row_of(board, core)
