"""The weak form of every shipped mechanism on every emulated board, in both cores: its bits, and the cost of a tick."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import numpy.typing as npt

from bench.case import DIFFERS, Advance, Report
from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS, Board
from pvid.board.mechanism_image import build_mechanism_image, mechanism_run
from pvid.board.mechanism_image import native_hashes as float_hashes
from pvid.board.mechanism_image_q31 import build_fixed_image, fixed_run
from pvid.board.mechanism_image_q31 import native_hashes as fixed_hashes
from pvid.board.replay_image import ReplayReport, play
from pvid.settings.enums import Core

HEADER = ("board", "core", *KINDS, "bits")
CORES: tuple[Core, ...] = ("f32", "q31")
# One of each instruction set, with a floating point unit and without one.
USUAL = (
    *("microbit", "mps2-an385", "mps2-an386", "mps2-an505", "mps3-an547"),
    *("virt-rv32imac", "virt-rv32imafc", "atmega2560"),
)
TIMEOUT_S = 600.0
_NO_FIGURE = {"the image does not fit": "no room", "float32 has no bits of the twin": "no float32"}


def differs(report: ReplayReport, expected: npt.NDArray[np.uint32]) -> bool:
    """Whether a hash of the board is not that of the core here at the same tick, or the run ended early."""
    return report.ticks != len(expected) or report.differs_at(expected) is not None


def rows(names: tuple[str, ...] = USUAL) -> tuple[tuple[Board, Core], ...]:
    """Of the boards of these names."""
    return tuple((BOARDS[name], core) for name in names for core in CORES)


@cache
def expected(name: str, core: Core) -> npt.NDArray[np.uint32]:
    """Hashes of the core here on a mechanism's shipped rig."""
    return float_hashes(mechanism_run(name)) if core == "f32" else fixed_hashes(fixed_run(name))


def played(board: Board, name: str, core: Core) -> tuple[ReplayReport, npt.NDArray[np.uint32]]:
    """A mechanism's shipped rig on a board, and the hashes of the core here.

    Raises PvidError where it does not fit, or the board's float32 is another one.
    """
    if core == "f32":
        image, _ = build_mechanism_image(board, mechanism_run(name))
    else:
        image, _ = build_fixed_image(board, fixed_run(name))
    return play(board, image, TIMEOUT_S), expected(name, core)


def reason_for_no_figure(error: PvidError) -> str:
    """In a word; an error that is a fault of the image or of the machine is raised again."""
    for sentence, word in _NO_FIGURE.items():
        if sentence in str(error):
            return word
    raise error


def row_of(board: Board, core: Core, names: tuple[str, ...] = KINDS) -> tuple[str, ...]:
    """Mean instructions of a tick (an AVR: clock cycles) of each mechanism, and whether all bits are the same.

    Raises PvidError where an image fails.
    """
    cells, equal = [], "-"
    for name in names:
        try:
            report, wanted = played(board, name, core)
        except PvidError as error:
            cells.append(reason_for_no_figure(error))
            continue
        cells.append(f"{report.instructions_mean:.0f}")
        equal = DIFFERS if differs(report, wanted) or equal == DIFFERS else "equal"
    return f"{board.core} ({board.name})", core, *cells, equal


def report(board: tuple[str, ...], advance: Advance) -> Report:
    """See bench.case: two rows for each board."""

    def made() -> Iterator[tuple[str, ...]]:
        for one, core in rows(board or USUAL):
            yield row_of(one, core)
            advance()

    return Report([("model-boards", HEADER, made())])
